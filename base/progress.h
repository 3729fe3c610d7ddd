#pragma once

#include <string>

namespace slalom::base {

/// "1.2M", "34.5k", "678": a count for people.
std::string FormatCount(double count);

/// "2:05", "1:02:03": a duration in seconds for people.
std::string FormatDuration(double seconds);

/// Shows how long work goes on standard error: one line rewritten in place on a terminal, a plain
/// line every ten seconds elsewhere, so none for short work. Confined to one thread.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Shows `text` if it is time to, cut to the terminal's width; `now_s` [s] is any clock that goes
  /// forward.
  void Show(const std::string& text, double now_s);

  /// Ends the rewritten line so that other output starts on a fresh one.
  void End();

 private:
  const bool terminal_;
  std::string open_line_;  ///< Empty where the cursor stands on a fresh line.
  bool shown_before_ = false;
  double last_shown_s_ = -1e9;
};

}  // namespace slalom::base
