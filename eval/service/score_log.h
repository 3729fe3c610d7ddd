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
  /// Appends to an existing file; sets one with other columns aside as scores.csv.before. Throws
  /// `base::Error` if the file cannot be read or written.
  ScoreLog(const std::filesystem::path& path, std::string_view course_set);

  /// Adds the line of policy `version`, scored in `seconds`. `kept`: whether the policy is saved as
  /// the best so far. Fails if the line cannot be written.
  [[nodiscard]] std::optional<base::Failure> Append(const Figures& set, std::int64_t version,
                                                    double seconds, bool kept);

  /// The best success rate on this course set of a policy that was saved, when the file was opened,
  /// to four digits; -1 if there was none. A score whose policy could not be saved does not count.
  double best_before() const { return best_before_; }

 private:
  std::string courses_;  ///< The course set as a cell of the file.
  base::AppendFile file_;
  double best_before_ = -1.0;
};

}  // namespace slalom::eval
