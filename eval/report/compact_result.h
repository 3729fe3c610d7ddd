#pragma once

#include <string>
#include <string_view>

namespace slalom::eval {

/// Returns the text of an evaluation.json with what `ParseResult` reads and no more: a line for
/// each course, a letter for the outcome of each episode, no path of the machine that it was made
/// on. The same evaluation gives the same text. Throws like `ParseResult`; errors call the text
/// `source`.
std::string CompactResult(std::string_view text, const std::string& source);

}  // namespace slalom::eval
