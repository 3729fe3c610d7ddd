#pragma once

#include <string>
#include <string_view>

/// Text as a cell of a table, whatever characters it has.

namespace slalom::eval {

/// Line breaks become spaces.
std::string EscapeMarkdown(std::string_view text);

/// Line breaks become spaces.
std::string EscapeLatex(std::string_view text);

/// In quotes where it needs them.
std::string CsvField(const std::string& text);

}  // namespace slalom::eval
