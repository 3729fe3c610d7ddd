#include "base/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

namespace slalom::base {
namespace {

constexpr double kTerminalInterval = 0.2;  // [s]
constexpr double kPlainInterval = 10.0;    // [s]

/// A line that were longer would wrap, and could not be rewritten in place.
std::size_t TerminalWidth() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col < 2) return 79;
  return size.ws_col - 1u;
}

}  // namespace

std::string FormatCount(double count) {
  if (count >= 999'950.0) return fmt::format("{:.2f}M", count / 1e6);
  if (count >= 9'999.5) return fmt::format("{:.0f}k", count / 1e3);
  return fmt::format("{:.0f}", count);
}

std::string FormatDuration(double seconds) {
  const auto s = static_cast<long long>(std::llround(seconds));
  if (s >= 3600) return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
  return fmt::format("{}:{:02}", s / 60, s % 60);
}

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() { End(); }

void ProgressLine::Show(const std::string& text, double now_s) {
  // In a log, work that is over within the interval leaves no line.
  if (!terminal_ && !shown_before_) last_shown_s_ = now_s;
  shown_before_ = true;
  if (now_s - last_shown_s_ < (terminal_ ? kTerminalInterval : kPlainInterval)) return;
  last_shown_s_ = now_s;
  if (terminal_) {
    open_line_ = text.substr(0, TerminalWidth());
    fmt::print(stderr, "\r\x1b[K{}", open_line_);
    std::fflush(stderr);
  } else {
    fmt::print(stderr, "{}\n", text);
  }
}

void ProgressLine::End() {
  // Once more, as a message may have taken its place.
  if (!open_line_.empty()) fmt::print(stderr, "\r\x1b[K{}\n", open_line_);
  open_line_.clear();
}

}  // namespace slalom::base
