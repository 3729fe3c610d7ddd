#pragma once

#include <string>

namespace slalom::eval {

/// Returns the text in quotes if a CSV file needs them.
std::string CsvField(const std::string& text);

}  // namespace slalom::eval
