#pragma once

#include <fmt/format.h>

#include <string_view>

/// Checks for our own mistakes. They are on in every build. Mistakes that a user or a peer may make
/// are reported through `base::Error` or `base::Result`, never through these checks.

namespace slalom::base {

/// Prints `message` with the file and line, and aborts. Called by the macros below.
[[noreturn]] void CheckFailed(const char* file, int line, std::string_view message);

}  // namespace slalom::base

/// Aborts with the text of the condition if it does not hold.
#define SLALOM_CHECK(condition)                                                     \
  do {                                                                              \
    if (!(condition)) [[unlikely]]                                                  \
      ::slalom::base::CheckFailed(__FILE__, __LINE__, "check failed: " #condition); \
  } while (false)

/// Aborts with both values if the comparison does not hold.
#define SLALOM_CHECK_OP(op, a, b)                                                                \
  do {                                                                                           \
    const auto& slalom_check_a = (a);                                                            \
    const auto& slalom_check_b = (b);                                                            \
    if (!(slalom_check_a op slalom_check_b)) [[unlikely]]                                        \
      ::slalom::base::CheckFailed(__FILE__, __LINE__,                                            \
                                  fmt::format("check failed: " #a " " #op " " #b " ({} and {})", \
                                              slalom_check_a, slalom_check_b));                  \
  } while (false)

#define SLALOM_CHECK_EQ(a, b) SLALOM_CHECK_OP(==, a, b)
#define SLALOM_CHECK_LT(a, b) SLALOM_CHECK_OP(<, a, b)
#define SLALOM_CHECK_LE(a, b) SLALOM_CHECK_OP(<=, a, b)
#define SLALOM_CHECK_GE(a, b) SLALOM_CHECK_OP(>=, a, b)
#define SLALOM_CHECK_GT(a, b) SLALOM_CHECK_OP(>, a, b)
