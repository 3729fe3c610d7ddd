#pragma once

#include <fmt/format.h>
#include <stdlib.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

/// failing_libc.cc, if this program is linked with it.
extern "C" __attribute__((weak)) void slalom_set_failing_call(const char* rule);
extern "C" __attribute__((weak)) long slalom_num_failing_calls();

namespace slalom::test {

/// Calls of the C library that are to fail, as on a disk that is full or out of reach for a moment.
struct FailingCall {
  std::string_view function;  ///< Pattern of functions of failing_libc.cc: open, f*sync, ...
  std::string_view path{};    ///< Pattern of the paths that count, as fnmatch(3) has it.
  int error = 0;              ///< What errno then is. 0: a part of the bytes is read or written.
  int first = 1;              ///< Number of the first of these calls that fails.
  int last = first;           ///< Number of the last one.
};

/// While one of these lives, such calls fail: in this program, which is linked with
/// failing_libc.cc, or in every program that it starts if `library` is failing_libc.cc as a
/// library. Calls are numbered over all of these programs, from 1. One at a time.
class FailingCalls {
 public:
  /// `count`: a file to make, which counts the calls of other programs.
  FailingCalls(const FailingCall& call, std::filesystem::path count,
               const std::string& library = "")
      : count_(std::move(count)),
        is_here_(library.empty()),
        rule_(fmt::format("{} {} {} {} {} {}", call.function, call.path, call.error, call.first,
                          call.last, count_.string())) {
    if (is_here_) {
      slalom_set_failing_call(rule_.c_str());
      return;
    }
    setenv("SLALOM_FAILING_CALL", rule_.c_str(), 1);
    setenv("LD_PRELOAD", library.c_str(), 1);
  }
  ~FailingCalls() {
    if (is_here_) slalom_set_failing_call(nullptr);
    unsetenv("SLALOM_FAILING_CALL");
    unsetenv("LD_PRELOAD");
  }
  FailingCalls(const FailingCalls&) = delete;
  FailingCalls& operator=(const FailingCalls&) = delete;

  /// How many such calls there were. A test expects at least `first`, or none of them failed.
  int num_calls() const {
    if (is_here_) return static_cast<int>(slalom_num_failing_calls());
    std::error_code none;
    const std::uintmax_t size = std::filesystem::file_size(count_, none);
    return none ? 0 : static_cast<int>(size);
  }

 private:
  const std::filesystem::path count_;
  const bool is_here_;
  const std::string rule_;
};

}  // namespace slalom::test
