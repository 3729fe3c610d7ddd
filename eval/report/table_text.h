#pragma once

#include <string>
#include <string_view>

/// Escapes any text for a cell of a table.

namespace slalom::eval {

/// Line breaks become spaces.
std::string EscapeMarkdown(std::string_view text);

/// Line breaks become spaces.
std::string EscapeLatex(std::string_view text);

/// Adds quotes if needed.
std::string CsvField(const std::string& text);

}  // namespace slalom::eval
