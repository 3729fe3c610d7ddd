#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_field.h"
#include "sim/courses/course.h"

namespace slalom::sim {

/// A generator of fresh courses for training.
enum class FreshKind { kStatic, kBox, kWall, kCrowds, kHalls, kRooms, kCylinders };
base::OneOf EnumNames(FreshKind);

/// What there is of a kind.
struct FreshSource {
  std::string_view name;
  std::string_view prefix;  ///< Sets are named PREFIX + "SEED:COUNT".
  /// Course `number` of a stream, of which `seed` is the course's own.
  Course (*course)(std::string name, std::uint64_t seed, int number);
  CourseSet (*set)(std::uint64_t seed, int count);
};

/// One for each kind, in their order.
std::span<const FreshSource> FreshSources();

/// The generators of a training's fresh courses, in turn: course n is of kind n % size. A kind may
/// occur several times. Empty: there are no fresh courses.
using FreshMix = std::vector<FreshKind>;

/// Reads "none", or names of kinds joined by "+", for example "static+static+crowds". Throws
/// `base::Error` for any other text.
FreshMix ParseFreshMix(std::string_view text);

/// The kind of course `number`. Requires: !mix.empty(), number >= 0.
inline FreshKind KindOf(const FreshMix& mix, int number) {
  return mix[static_cast<std::size_t>(number) % mix.size()];
}

/// Returns course `number` of the endless stream of `seed`, named "stream-SEED-NUMBER".
///
/// It is a function of (mix, seed, number) alone, bit for bit, and like the courses of
/// `GenerateFreshCourses` and its counterparts of the other kinds. The courses of a kind are the
/// same in every mix, and in the same order. No set that `ResolveCourses` makes has a course of a
/// stream, whatever the seeds, so a score on generated courses is a score on unseen ones.
///
/// Requires: !mix.empty(), number >= 0. Cost: on average 0.7 ms for a static course or a crowd,
/// 0.1 ms for a course with boxes or walls, 5 ms for a hall, 4 ms for rooms.
Course GenerateStreamCourse(const FreshMix& mix, std::uint64_t seed, int number);

}  // namespace slalom::sim
