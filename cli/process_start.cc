#include "cli/process_start.h"

#include <time.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace slalom::cli {

std::chrono::steady_clock::time_point ProcessStart() {
  const auto now = std::chrono::steady_clock::now();
  std::ifstream file("/proc/self/stat");
  const std::string stat((std::istreambuf_iterator<char>(file)), {});
  // proc(5): the program's name in brackets is field 2, the start time in clock ticks since boot
  // field 22.
  const auto name_end = stat.rfind(')');
  if (name_end == std::string::npos) return now;
  std::istringstream fields(stat.substr(name_end + 1));
  std::string skipped;
  for (int field = 3; field < 22; ++field) fields >> skipped;
  double ticks = 0.0;
  timespec boot_time{};
  if (!(fields >> ticks) || clock_gettime(CLOCK_BOOTTIME, &boot_time) != 0) return now;
  const double age = static_cast<double>(boot_time.tv_sec) +
                     1e-9 * static_cast<double>(boot_time.tv_nsec) -
                     ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
  if (!(age >= 0.0)) return now;
  return now - std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                   std::chrono::duration<double>(age));
}

}  // namespace slalom::cli
