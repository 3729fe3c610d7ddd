#pragma once

#include <array>
#include <initializer_list>
#include <string_view>
#include <vector>

/// How a config struct lists its fields. Each struct has one member template
///
///     template <class Visitor>
///     void Visit(Visitor& v) {
///       v("num_beams", num_beams, base::Range{1, 4096}, "", "Beams of a scan.");
///       v("device", device, base::OneOf{"auto", "cpu"}, "", "Where to compute.");
///       v("save_replay", save_replay, "Keep the replay buffer in checkpoints.");
///       v("name", name, "Free text.");
///       v.Section("lidar", lidar, "The range finder.");
///     }
///
/// which gives for each field its key, the field itself, its range or choices (none for bool and
/// free text), its unit and its meaning. From this list config/config.h reads, checks, prints and
/// documents the struct. A field is a bool, int, std::int64_t, double, std::string,
/// std::vector<int> or std::vector<double>.

namespace slalom::base {

/// The closed interval in which a numeric field, or each element of a list, must lie.
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
