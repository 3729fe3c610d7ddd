#include "eval/report/compact_result.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "eval/report/result.h"

namespace slalom::eval {
namespace {

using Json = nlohmann::ordered_json;

std::string Print(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json CourseJson(const ResultCourse& course, double step) {
  std::string outcomes;
  Json times = Json::array();
  Json steps = Json::array();
  Json collisions = Json::array();
  bool are_implied = true;
  bool are_steps = true;
  for (const ResultEpisode& episode : course.episodes) {
    outcomes += env::ToString(episode.outcome).front();
    times.push_back(episode.time);
    const int count = static_cast<int>(std::lround(episode.time / step));
    steps.push_back(count);
    are_steps = are_steps && count * step == episode.time;
    collisions.push_back(episode.num_collisions);
    const int implied = episode.outcome == env::Outcome::kCollision ? 1 : 0;
    are_implied = are_implied && episode.num_collisions == implied;
  }
  Json json = {
      {"course", course.name}, {"optimal_time_s", course.optimal_time}, {"outcomes", outcomes}};
  json[are_steps ? "steps" : "times_s"] = std::move(are_steps ? steps : times);
  if (!are_implied) json["collisions_per_episode"] = std::move(collisions);
  return json;
}

}  // namespace

std::string CompactResult(std::string_view text, const std::string& source) {
  const Result result = ParseResult(text, source).result;
  const Json full = Json::parse(text);
  std::string compact = "{\n";
  for (const auto& [key, value] : full.items()) {
    if (key == "courses") continue;
    Json kept = value;
    if (key == "provenance") {
      kept.erase("config");
      // Where the policy and the courses lay, on the machine that drove.
      for (const char* path : {"source", "collection"}) {
        kept[path] = std::filesystem::path(kept[path].get<std::string>()).filename().string();
      }
    }
    compact += Print(key) + ": " + Print(kept) + ",\n";
  }
  compact += "\"courses\": [\n";
  for (const ResultCourse& course : result.courses) {
    if (&course != &result.courses.front()) compact += ",\n";
    compact += Print(CourseJson(course, result.step));
  }
  return compact + "\n]\n}\n";
}

}  // namespace slalom::eval
