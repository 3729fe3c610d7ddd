#pragma once

#include <array>
#include <initializer_list>
#include <string_view>
#include <vector>

/// How a config struct lists its fields. Each struct has one member template
///
///     template <class Visitor>
///     void Visit(Visitor& v) {
///       v("num_beams", num_beams, base::Range{1, 4096}, "", "Rays per scan.");
///       v("device", device, base::OneOf{"auto", "cpu", "cuda"}, "", "Where the learner
///       computes."); v("save_replay", save_replay, "Keep the replay buffer in checkpoints.");
///       v("name", name, "Free text.");
///       v.Section("lidar", lidar, "The range finder.");
///     }
///
/// with, for each field: its key, the field, its range or choices (none for bool and free text),
/// its unit and its meaning. From this list `config/` parses, checks, prints, hashes and documents.
/// Field types: bool, int, int64_t, double, std::string, std::vector<int>, std::vector<double>.

namespace slalom::base {

/// Closed interval that a numeric field, or each element of a list, must lie in.
struct Range {
  double min;
  double max;
};

/// The texts that a string field may hold.
struct OneOf {
  OneOf(std::initializer_list<std::string_view> texts) : choices(texts) {}
  std::vector<std::string_view> choices;
};

}  // namespace slalom::base
