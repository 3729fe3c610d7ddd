#include "metrics/process.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

namespace slalom::metrics {
namespace {

// Positions of fields in /proc/self/stat (proc(5), which counts them from 3), counted from after
// the program's name. The name stands in parentheses and may hold any character.
constexpr std::size_t kUserTicks = 11;
constexpr std::size_t kSystemTicks = 12;
constexpr std::size_t kThreads = 17;
constexpr std::size_t kStartTicks = 19;
constexpr std::size_t kVirtualBytes = 20;
constexpr std::size_t kResidentPages = 21;

std::vector<double> ReadStat() {
  std::ifstream in("/proc/self/stat");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto name_end = text.rfind(") ");
  if (name_end == std::string::npos) return {};
  std::istringstream fields(text.substr(name_end + 2));
  std::string state;
  fields >> state;
  std::vector<double> numbers{0.0};
  for (double number = 0.0; fields >> number;) numbers.push_back(number);
  return numbers;
}

/// When the machine started, [s] since 1970.
std::optional<double> BootTime() {
  std::ifstream in("/proc/stat");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("btime ")) return std::stod(line.substr(6));
  }
  return std::nullopt;
}

std::optional<double> CountDescriptors() {
  std::error_code error;
  std::filesystem::directory_iterator it("/proc/self/fd", error);
  if (error) return std::nullopt;
  double count = -1.0;  // Leaves out the descriptor through which the directory is read.
  for (const auto end = std::filesystem::directory_iterator(); it != end; it.increment(error)) {
    if (error) return std::nullopt;
    ++count;
  }
  return count;
}

}  // namespace

ProcessFigures ReadProcessFigures() {
  ProcessFigures figures;
  const std::vector<double> stat = ReadStat();
  if (stat.size() > kResidentPages) {
    const auto ticks_per_s = static_cast<double>(sysconf(_SC_CLK_TCK));
    figures.cpu_seconds = (stat[kUserTicks] + stat[kSystemTicks]) / ticks_per_s;
    figures.threads = stat[kThreads];
    figures.virtual_bytes = stat[kVirtualBytes];
    figures.resident_bytes = stat[kResidentPages] * static_cast<double>(sysconf(_SC_PAGESIZE));
    if (const auto boot = BootTime()) figures.start_time = *boot + stat[kStartTicks] / ticks_per_s;
  }
  figures.open_descriptors = CountDescriptors();
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    figures.max_descriptors = static_cast<double>(limit.rlim_cur);
  }
  return figures;
}

}  // namespace slalom::metrics
