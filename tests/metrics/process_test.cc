#include "metrics/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <thread>
#include <vector>

namespace slalom::metrics {
namespace {

TEST(ProcessFiguresTest, MemoryFollowsWhatIsTouched) {
  constexpr std::size_t kBytes = 64 << 20;
  const ProcessFigures before = ReadProcessFigures();
  void* block = mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(block, MAP_FAILED);
  const ProcessFigures mapped = ReadProcessFigures();
  std::memset(block, 1, kBytes);
  const ProcessFigures touched = ReadProcessFigures();
  munmap(block, kBytes);
  // The kernel may count late by some pages of each thread: 1 MB is far above that.
  constexpr double kSlack = 1 << 20;
  EXPECT_GE(*mapped.virtual_bytes - *before.virtual_bytes, kBytes - kSlack);
  EXPECT_LE(*mapped.resident_bytes - *before.resident_bytes, kBytes / 2.0);
  EXPECT_GE(*touched.resident_bytes - *mapped.resident_bytes, kBytes - kSlack);
}

TEST(ProcessFiguresTest, DescriptorsAreCounted) {
  const ProcessFigures before = ReadProcessFigures();
  std::vector<int> open;
  for (int i = 0; i < 10; ++i) open.push_back(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const ProcessFigures after = ReadProcessFigures();
  for (const int fd : open) close(fd);
  EXPECT_EQ(*after.open_descriptors, *before.open_descriptors + 10.0);
  EXPECT_EQ(*ReadProcessFigures().open_descriptors, *before.open_descriptors);
  EXPECT_LE(*before.open_descriptors, *before.max_descriptors);
}

// Against another call of the kernel, taken before and after.
TEST(ProcessFiguresTest, ProcessorTimeIsThatOfAllThreads) {
  const auto used = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
      return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
  };
  std::jthread([&used] {
    while (used() < 0.2) continue;
  }).join();
  const double before = used();
  const double seconds = *ReadProcessFigures().cpu_seconds;
  // Two numbers in whole ticks of 10 ms, cut off.
  EXPECT_GE(seconds, before - 0.03);
  EXPECT_LE(seconds, used() + 0.01);
}

TEST(ProcessFiguresTest, ThreadsAreCounted) {
  const double before = *ReadProcessFigures().threads;
  double during = 0.0;
  std::jthread([&during] { during = *ReadProcessFigures().threads; }).join();
  EXPECT_EQ(during, before + 1.0);
}

TEST(ProcessFiguresTest, ItStartedBeforeNowAndAfterTheMachine) {
  const double now =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  const double start = *ReadProcessFigures().start_time;
  EXPECT_LE(start, now + 1.0);  // The machine's start is known in whole seconds.
  timespec uptime{};
  clock_gettime(CLOCK_BOOTTIME, &uptime);
  EXPECT_GE(start, now - static_cast<double>(uptime.tv_sec) - 2.0);
  EXPECT_EQ(start, *ReadProcessFigures().start_time);
}

}  // namespace
}  // namespace slalom::metrics
