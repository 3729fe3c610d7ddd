#include "base/check.h"

#include <cstdio>
#include <cstdlib>

namespace slalom::base {

void CheckFailed(const char* file, int line, std::string_view message) {
  fmt::print(stderr, "{}:{}: {}\n", file, line, message);
  std::fflush(stderr);
  std::abort();
}

}  // namespace slalom::base
