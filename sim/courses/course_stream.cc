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
#include "sim/courses/indoor_generators.h"

namespace slalom::sim {
namespace {

constexpr FreshSource kSources[] = {
    {"static", "generated:",
     [](std::string name, std::uint64_t seed, int number) {
       return GenerateCourse(std::move(name), PublishedRecipe(number % kNumRecipes), seed);
     },
     GenerateFreshCourses},
    {"box", "generated-box:",
     [](std::string name, std::uint64_t seed, int) {
       const DynamicBoxRecipe recipe;
       base::Random random(base::DeriveSeed(seed, "pool"));
       return GenerateBoxCourse(std::move(name), recipe, DrawBoxTrajectories(recipe, random), seed);
     },
     GenerateFreshBoxCourses},
    {"wall", "generated-wall:",
     [](std::string name, std::uint64_t seed, int) {
       return GenerateWallCourse(std::move(name), {}, seed);
     },
     GenerateFreshWallCourses},
    {"crowds", "generated-crowds:",
     [](std::string name, std::uint64_t seed, int) {
       return GenerateCrowdCourse(std::move(name), {}, seed);
     },
     GenerateFreshCrowdCourses},
    {"halls", "generated-halls:",
     [](std::string name, std::uint64_t seed, int) {
       return GenerateHallCourse(std::move(name), {}, seed);
     },
     GenerateFreshHallCourses},
    {"rooms", "generated-rooms:",
     [](std::string name, std::uint64_t seed, int) {
       return GenerateRoomCourse(std::move(name), {}, seed);
     },
     GenerateFreshRoomCourses},
    {"cylinders", "generated-cylinders:",
     [](std::string name, std::uint64_t seed, int) {
       return GenerateCrowdCourse(std::move(name), kCylinderField, seed);
     },
     GenerateFreshCylinderCourses}};

}  // namespace

std::span<const FreshSource> FreshSources() { return kSources; }

base::OneOf EnumNames(FreshKind) {
  base::OneOf names({});
  for (const FreshSource& source : kSources) names.choices.push_back(source.name);
  return names;
}

FreshMix ParseFreshMix(std::string_view text) {
  if (text == "none") return {};
  FreshMix mix;
  for (const std::string_view kind : base::Split(text, '+')) {
    if (!base::ParseEnum(kind, mix.emplace_back())) {
      throw base::Error("\"{}\": expected \"none\", or one or more of {} joined by \"+\"", text,
                        fmt::join(EnumNames(FreshKind{}).choices, ", "));
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
  const int own_number = number / size * per_round + static_cast<int>(num_before);
  const std::uint64_t own_seed =
      base::DeriveSeed(seed, "stream-course", {static_cast<std::uint64_t>(own_number)});
  return kSources[static_cast<std::size_t>(kind)].course(fmt::format("stream-{}-{}", seed, number),
                                                         own_seed, own_number);
}

}  // namespace slalom::sim
