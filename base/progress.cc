#include "base/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace slalom::base {
namespace {

constexpr double kTerminalInterval = 0.2;       // [s]
constexpr double kFirstPlainInterval = 10.0;    // [s]
constexpr double kLongestPlainInterval = 60.0;  // [s]

/// Unlike fmt::print this does not throw if the other end is gone.
void Write(std::FILE* out, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), out);
  std::fflush(out);
}

}  // namespace

std::size_t TerminalColumns(std::FILE* out) {
  winsize size{};
  if (ioctl(fileno(out), TIOCGWINSZ, &size) != 0 || size.ws_col < 2) return 80;
  return size.ws_col;
}

std::string FormatCount(double count) {
  for (const auto& [unit, size] : {std::pair{"G", 1e9}, {"M", 1e6}, {"k", 1e3}}) {
    // Less would be rounded to 1000 of the next unit.
    if (count >= 0.9995 * size) return fmt::format("{:.3g}{}", count / size, unit);
  }
  return fmt::format("{:.3g}", count);
}

std::string FormatBytes(double bytes) {
  const double mb = bytes / 1e6;
  return mb < 999.5 ? fmt::format("{:.0f} MB", mb) : fmt::format("{:.1f} GB", mb / 1e3);
}

std::string FormatDuration(double seconds) {
  const auto s = static_cast<long long>(std::llround(seconds));
  if (s >= 3600) return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
  return fmt::format("{}:{:02}", s / 60, s % 60);
}

ProgressLine::ProgressLine() : ProgressLine(stderr, isatty(STDERR_FILENO) == 1) {}

ProgressLine::ProgressLine(std::FILE* out, bool terminal)
    : out_(out),
      terminal_(terminal),
      interval_s_(terminal ? kTerminalInterval : kFirstPlainInterval) {}

ProgressLine::~ProgressLine() { End(); }

void ProgressLine::Show(const std::string& text, double now_s) {
  last_text_ = text;
  if (!timed_) {
    timed_ = true;
    // A terminal shows the first text at once. A log has none of work that is over soon.
    last_shown_s_ = terminal_ ? now_s - interval_s_ : now_s;
  }
  if (now_s - last_shown_s_ < interval_s_) return;
  last_shown_s_ = now_s;
  shown_ = true;
  if (terminal_) {
    Rewrite(text);
  } else {
    Write(out_, text + "\n");
    interval_s_ = std::min(2.0 * interval_s_, kLongestPlainInterval);
    last_text_.clear();
  }
}

void ProgressLine::Rewrite(const std::string& text) {
  // A line of the terminal's full width would wrap. If the terminal has become narrower since the
  // last time, then the line that stands there has wrapped: its first row is further up.
  const std::size_t columns = TerminalColumns(out_);
  const std::size_t rows_above = line_width_ > 0 ? (line_width_ - 1) / columns : 0;
  const std::string up = rows_above > 0 ? fmt::format("\x1b[{}A", rows_above) : "";
  const std::string line = text.substr(0, columns - 1);
  Write(out_, "\r" + up + "\x1b[J" + line);
  line_width_ = line.size();
}

void ProgressLine::End() {
  if (shown_ && terminal_) {
    Rewrite(last_text_);
    Write(out_, "\n");
  } else if (shown_ && !last_text_.empty()) {
    Write(out_, last_text_ + "\n");
  }
  line_width_ = 0;
  shown_ = false;
  last_text_.clear();
}

}  // namespace slalom::base
