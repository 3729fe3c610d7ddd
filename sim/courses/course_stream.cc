#include "sim/courses/course_stream.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "base/split.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/crowd_generator.h"
#include "sim/courses/dynamic_generator.h"
#include "sim/courses/hall_generator.h"
#include "sim/courses/room_generator.h"

namespace slalom::sim {
namespace {

/// Course `number` of a kind.
Course GenerateOfKind(FreshKind kind, std::string name, std::uint64_t seed, int number) {
  const std::uint64_t own =
      base::DeriveSeed(seed, "stream-course", {static_cast<std::uint64_t>(number)});
  switch (kind) {
    case FreshKind::kStatic:
      return GenerateCourse(std::move(name), PublishedRecipe(number % kNumRecipes), own);
    case FreshKind::kBox: {
      const DynamicBoxRecipe recipe;
      base::Random random(base::DeriveSeed(own, "pool"));
      return GenerateBoxCourse(std::move(name), recipe, DrawBoxTrajectories(recipe, random), own);
    }
    case FreshKind::kWall:
      return GenerateWallCourse(std::move(name), {}, own);
    case FreshKind::kCrowds:
      return GenerateCrowdCourse(std::move(name), {}, own);
    case FreshKind::kHalls:
      return GenerateHallCourse(std::move(name), {}, own);
    case FreshKind::kRooms:
      return GenerateRoomCourse(std::move(name), {}, own);
    case FreshKind::kCylinders:
      return GenerateCrowdCourse(std::move(name), kCylinderField, own);
  }
  base::CheckFailed(__FILE__, __LINE__, "no generator");
}

}  // namespace

FreshMix ParseFreshMix(std::string_view text) {
  if (text == "none") return {};
  FreshMix mix;
  for (const std::string_view kind : base::Split(text, '+')) {
    if (!base::ParseEnum(kind, mix.emplace_back())) {
      throw base::Error(
          fmt::format("\"{}\": expected \"none\", or one or more of {} joined by \"+\"", text,
                      fmt::join(EnumNames(FreshKind{}).choices, ", ")));
    }
  }
  return mix;
}

Course GenerateStreamCourse(const FreshMix& mix, std::uint64_t seed, int number) {
  SLALOM_CHECK(!mix.empty());
  SLALOM_CHECK_GE(number, 0);
  const int size = static_cast<int>(mix.size());
  const int turn = number % size;
  const FreshKind kind = KindOf(mix, number);
  const auto num_before = std::count(mix.begin(), mix.begin() + turn, kind);
  const int per_round = static_cast<int>(std::ranges::count(mix, kind));
  return GenerateOfKind(kind, fmt::format("stream-{}-{}", seed, number), seed,
                        number / size * per_round + static_cast<int>(num_before));
}

}  // namespace slalom::sim
