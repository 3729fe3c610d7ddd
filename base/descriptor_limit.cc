#include "base/descriptor_limit.h"

#include <sys/resource.h>

#include <algorithm>

namespace slalom::base {

void RaiseDescriptorLimit() {
  constexpr rlim_t kEnough = 65536;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t raised = std::min(limit.rlim_max, kEnough);
  if (raised <= limit.rlim_cur) return;
  limit.rlim_cur = raised;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace slalom::base
