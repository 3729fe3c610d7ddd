#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

namespace slalom::base {

/// "2.5M", "34.5k", "678": a count for people, in three digits.
std::string FormatCount(double count);

/// "820 MB", "1.5 GB": a size for people.
std::string FormatBytes(double bytes);

/// "2:05", "1:02:03": a duration in seconds for people.
std::string FormatDuration(double seconds);

/// The columns of the terminal to which `out` writes, at least 2; 80 if it does not tell.
std::size_t TerminalColumns(std::FILE* out);

/// Shows the progress of long work on standard error. On a terminal it rewrites one line in place,
/// at most five times a second. Elsewhere (a file, nohup, a batch system) it writes plain lines:
/// the first after ten seconds, later ones at intervals that grow to a minute, so that short work
/// leaves no line and long work one a minute. Text that cannot be written, for example to a closed
/// terminal, is left out. Confined to one thread.
class ProgressLine {
 public:
  ProgressLine();
  /// As above, with the destination given: a stream, and whether it is a terminal. Tests use it.
  ProgressLine(std::FILE* out, bool terminal);
  /// As `End`.
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Shows `text` if it is time to, cut to the terminal's present width. `now_s` [s] is any clock
  /// that goes forward.
  void Show(const std::string& text, double now_s);

  /// Ends the line so that other output starts on a fresh one. If an earlier text was shown, the
  /// line ends with the last text given, even if it was not yet time to show it.
  void End();

 private:
  void Rewrite(const std::string& text);

  std::FILE* const out_;
  const bool terminal_;
  std::string last_text_;       ///< Given to `Show`, and not shown yet.
  std::size_t line_width_ = 0;  ///< Width on the terminal; 0 if the cursor is on a fresh line.
  bool shown_ = false;          ///< Whether anything was shown since the last `End`.
  bool timed_ = false;
  double last_shown_s_ = 0.0;
  double interval_s_ = 0.0;  ///< Time until the next plain line.
};

}  // namespace slalom::base
