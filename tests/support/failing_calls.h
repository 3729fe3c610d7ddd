#pragma once

#include <fmt/format.h>
#include <stdlib.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace slalom::test {

/// Calls of the C library that are to fail, as on a disk that is full or out of reach for a moment.
struct FailingCall {
  std::string_view function;  ///< One of failing_libc.cc: open, openat, readdir, stat, ...
  std::string_view path;      ///< Pattern of the paths that count, as fnmatch(3) has it.
  int error = 0;              ///< What errno then is.
  int first = 1;              ///< Number of the first of these calls that fails.
  int last = first;           ///< Number of the last one.
};

/// While one of these lives, such calls fail: in this program if it is linked with
/// failing_libc.cc, and in every program that it starts if `library` is failing_libc.cc as a
/// library. Calls are numbered over all of these programs, from 1. One at a time.
class FailingCalls {
 public:
  /// `count`: a file to make, which counts the calls.
  FailingCalls(const FailingCall& call, std::filesystem::path count,
               const std::string& library = "")
      : count_(std::move(count)) {
    const std::string rule = fmt::format("{} {} {} {} {} {}", call.function, call.path, call.error,
                                         call.first, call.last, count_.string());
    setenv("SLALOM_FAILING_CALL", rule.c_str(), 1);
    if (!library.empty()) setenv("LD_PRELOAD", library.c_str(), 1);
  }
  ~FailingCalls() {
    unsetenv("SLALOM_FAILING_CALL");
    unsetenv("LD_PRELOAD");
  }
  FailingCalls(const FailingCalls&) = delete;
  FailingCalls& operator=(const FailingCalls&) = delete;

  /// How many such calls there were. A test expects at least `first`, or none of them failed.
  int num_calls() const {
    std::error_code none;
    const std::uintmax_t size = std::filesystem::file_size(count_, none);
    return none ? 0 : static_cast<int>(size);
  }

 private:
  const std::filesystem::path count_;
};

}  // namespace slalom::test
