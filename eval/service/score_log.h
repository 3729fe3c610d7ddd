#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/append_file.h"
#include "eval/summary.h"

namespace slalom::eval {

/// scores.csv: a line for each policy that an evaluator scored. Thread-compatible.
class ScoreLog {
 public:
  /// Appends to an existing file. Throws `base::Error` if it cannot be read or written.
  ScoreLog(const std::filesystem::path& path, std::string_view course_set);

  /// Adds the line of policy `version`, scored in `seconds`. Fails if it cannot be written.
  [[nodiscard]] std::optional<base::Failure> Append(const Figures& set, std::int64_t version,
                                                    double seconds);

  /// The best success rate on this course set that the file held when it was opened, to four
  /// digits; -1 if it held none.
  double best_before() const { return best_before_; }

 private:
  std::string courses_;  ///< The course set as a cell of the file.
  base::AppendFile file_;
  double best_before_ = -1.0;
};

}  // namespace slalom::eval
