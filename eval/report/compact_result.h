#pragma once

#include <string>
#include <string_view>

namespace slalom::eval {

/// Returns the text of an evaluation.json with only the parts that `ParseResult` reads: a line for
/// each course, a letter for the outcome of each episode, and no path of the machine that made it.
/// The same evaluation gives the same text. Throws like `ParseResult`; errors call the text
/// `source`.
std::string CompactResult(std::string_view text, const std::string& source);

}  // namespace slalom::eval
