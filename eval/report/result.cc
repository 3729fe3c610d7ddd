#include "eval/report/result.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "eval/report/report.h"
#include "sim/courses/course_file.h"

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kLargestTime = 1e6;  // [s]

/// A number and its interval, either of which may be null.
std::optional<Estimate> OptionalEstimate(const base::JsonObject& reader, const std::string& key,
                                         double max) {
  if (reader.Get(key).is_null()) return std::nullopt;
  Estimate estimate{reader.Number(key, 0.0, max), std::nullopt};
  const std::string interval_key = key + "_interval";
  const Json& interval = reader.Get(interval_key);
  if (interval.is_null()) return estimate;
  const std::string place = reader.place() + interval_key;
  if (!interval.is_array() || interval.size() != 2) {
    reader.Fail(place, interval, "[low, high] or null");
  }
  for (const Json& end : interval) reader.RequireNumber(place, end, 0.0, max);
  estimate.interval = Interval{interval[0].get<double>(), interval[1].get<double>()};
  return estimate;
}

Estimate RequiredEstimate(const base::JsonObject& reader, const std::string& key, double max) {
  const auto estimate = OptionalEstimate(reader, key, max);
  if (!estimate) {
    reader.Fail(reader.place() + key, nullptr, fmt::format("a number from 0 to {}", max));
  }
  return *estimate;
}

void RequireFormat(const base::JsonObject& reader) {
  if (const std::string format = reader.Text("format"); format != "slalom-evaluation") {
    throw base::Error("{}: format is \"{}\", expected \"slalom-evaluation\"", reader.source(),
                      format);
  }
  const int version = reader.Count("version");
  if (version == kResultVersion) return;
  throw base::Error("{}: version is {}, expected {}{}", reader.source(), version, kResultVersion,
                    version > kResultVersion ? "; it is from a newer slalom" : "");
}

Figures ReadFigures(const base::JsonObject& reader) {
  Figures figures;
  figures.num_episodes = reader.Count("episodes");
  figures.num_successes = reader.Count("successes");
  figures.num_collisions = reader.Count("collisions");
  figures.num_timeouts = reader.Count("timeouts");
  figures.num_contacts = reader.Count("contacts");
  figures.success_rate = RequiredEstimate(reader, "success_rate", 1.0);
  figures.collision_rate = RequiredEstimate(reader, "collision_rate", 1.0);
  figures.timeout_rate = RequiredEstimate(reader, "timeout_rate", 1.0);
  figures.contact_rate = RequiredEstimate(reader, "contact_rate", 1.0);
  figures.survival_time = OptionalEstimate(reader, "survival_time_s", kLargestTime);
  figures.traversal_time = OptionalEstimate(reader, "traversal_time_s", kLargestTime);
  figures.barn_score = RequiredEstimate(reader, "barn_score", 0.5);
  figures.barn_score_until_2024 = RequiredEstimate(reader, "barn_score_until_2024", 0.25);
  figures.mean_path_length = reader.Number("mean_path_length_m", 0.0, 1e9);
  return figures;
}

/// By its name, or by the letter with which that begins.
env::Outcome ReadOutcome(const base::JsonObject& reader, const Json& value) {
  for (const env::Outcome outcome :
       {env::Outcome::kSuccess, env::Outcome::kCollision, env::Outcome::kTimeout}) {
    const std::string_view name = env::ToString(outcome);
    if (value == name || value == name.substr(0, 1)) return outcome;
  }
  reader.Fail("an outcome", value, "success, collision or timeout");
}

/// A list of names; or a text, a letter for each.
Json OutcomesOf(const base::JsonObject& reader) {
  if (!reader.Get("outcomes").is_string()) return reader.List("outcomes");
  Json outcomes = Json::array();
  for (const char letter : reader.Text("outcomes")) outcomes.push_back(std::string(1, letter));
  return outcomes;
}

/// The times of a course's episodes, [s]; a compact file may count control steps of `step` seconds.
Json TimesOf(const base::JsonObject& reader, double step) {
  if (!reader.HasValue("steps")) return reader.List("times_s");
  Json times = Json::array();
  for (const Json& steps : reader.List("steps")) {
    reader.RequireCount("a number of steps", steps);
    times.push_back(steps.get<int>() * step);
  }
  return times;
}

ResultCourse ReadCourse(const base::JsonObject& reader, double step) {
  ResultCourse course{
      reader.Text("course"), reader.Number("optimal_time_s", 0.0, kLargestTime), {}};
  const Json outcomes = OutcomesOf(reader);
  const Json times = TimesOf(reader, step);
  Json collisions = Json::array();
  const bool is_compact = reader.Get("outcomes").is_string();
  if (!is_compact || reader.HasValue("collisions_per_episode")) {
    collisions = reader.List("collisions_per_episode");
  } else {  // One if it ended the episode, else none.
    for (const Json& outcome : outcomes) {
      collisions.push_back(ReadOutcome(reader, outcome) == env::Outcome::kCollision ? 1 : 0);
    }
  }
  if (outcomes.size() != times.size() || outcomes.size() != collisions.size()) {
    reader.Fail("the number of times or collisions of " + course.name, times.size(),
                fmt::format("{}, one for each outcome", outcomes.size()));
  }
  for (std::size_t k = 0; k < outcomes.size(); ++k) {
    reader.RequireNumber("a time", times[k], 0.0, kLargestTime);
    reader.RequireCount("a number of collisions", collisions[k]);
    course.episodes.push_back(
        {ReadOutcome(reader, outcomes[k]), times[k].get<double>(), collisions[k].get<int>()});
  }
  return course;
}

/// The randomised fields, if there are any.
std::vector<DrawnField> ReadDrawn(const base::JsonObject& reader, const Result& result) {
  std::vector<DrawnField> fields;
  if (!reader.HasValue("drawn")) return fields;
  for (std::size_t i = 0; i < reader.List("drawn").size(); ++i) {
    const base::JsonObject object = reader.Element("drawn", i);
    DrawnField& field = fields.emplace_back();
    field.key = object.Text("key");
    if (object.HasValue("names")) {
      for (const Json& name : object.List("names")) {
        if (!name.is_string()) object.Fail("a name", name, "a text");
        field.names.push_back(name.get<std::string>());
      }
      if (field.names.empty()) object.Fail("names", object.List("names"), "at least one name");
    } else {
      field.unit = object.Text("unit");
    }
    for (std::size_t c = 0; c < result.courses.size(); ++c) {
      const base::JsonObject drawn = reader.Element("courses", c).Object("drawn");
      const Json& values = drawn.List(field.key);
      if (values.size() != result.courses[c].episodes.size()) {
        drawn.Fail("the number of values of " + field.key, values.size(),
                   fmt::format("{}, one for each outcome", result.courses[c].episodes.size()));
      }
      std::vector<double>& numbers = field.values.emplace_back();
      for (const Json& value : values) {
        if (field.names.empty()) {
          drawn.RequireNumber("a value of " + field.key, value, -1e9, 1e9);
        } else {
          drawn.RequireCount("a value of " + field.key, value);
          drawn.RequireNumber("a value of " + field.key, value, 0.0,
                              static_cast<double>(field.names.size() - 1));
        }
        numbers.push_back(value.get<double>());
      }
    }
  }
  return fields;
}

/// The parts of one file must be of one evaluation.
void RequireConsistent(const Result& result, const base::JsonObject& reader) {
  int num_episodes = 0;
  int num_successes = 0;
  for (const ResultCourse& course : result.courses) {
    num_episodes += static_cast<int>(course.episodes.size());
    for (const ResultEpisode& e : course.episodes)
      num_successes += e.outcome == env::Outcome::kSuccess;
  }
  base::ThrowIf(
      num_episodes != result.set.num_episodes || num_successes != result.set.num_successes,
      "{}: says {} successes of {} episodes, but its courses hold {} of {}; the file was changed",
      reader.source(), result.set.num_successes, result.set.num_episodes, num_successes,
      num_episodes);
}

std::optional<TrainingOverlap> ReadOverlap(const base::JsonObject& provenance) {
  if (provenance.Get("training_overlap").is_null()) return std::nullopt;
  const base::JsonObject overlap = provenance.Object("training_overlap");
  return TrainingOverlap{overlap.Count("courses"), overlap.Count("of"), overlap.Text("trained_on")};
}

/// Empty if the file does not hold the config, as archives of sweeps.
std::map<std::string, std::string> ReadSettings(const base::JsonObject& provenance) {
  std::map<std::string, std::string> settings;
  if (!provenance.HasValue("config")) return settings;
  const std::string source = provenance.source() + ": provenance.config";
  for (auto& [key, value] : config::FlattenToml(provenance.Text("config"), source)) {
    settings.emplace(key, std::move(value.text));
  }
  return settings;
}

void ReadCoursesAndTracks(const fs::path& courses_file, const fs::path& tracks_file,
                          Result& result) {
  result.course_set_data = sim::ReadCourseSet(courses_file);
  const auto& courses = result.course_set_data.courses;
  bool is_same = courses.size() == result.courses.size();
  for (std::size_t c = 0; is_same && c < courses.size(); ++c) {
    is_same = courses[c]->name == result.courses[c].name;
  }
  base::ThrowIf(!is_same, "{}: does not hold the {} courses of {}", courses_file.string(),
                result.courses.size(), result.file);
  result.tracks = sim::ReadEpisodes(tracks_file);
  std::set<std::string_view> names;
  for (const auto& course : courses) names.insert(course->name);
  for (const sim::EpisodeTrack& track : result.tracks) {
    if (names.contains(track.course) && !track.poses.empty() && track.step > 0.0) continue;
    throw base::Error("{}: an episode on {} is not of {}: no such course, no poses or no step_s",
                      tracks_file.string(), track.course, result.file);
  }
}

}  // namespace

ParsedResult ParseResult(std::string_view text, const std::string& source) {
  base::ThrowIf(!base::IsShallowJson(text), "{}: nested more than {} deep, expected an evaluation",
                source, base::kMaxJsonDepth);
  Json object;
  try {
    object = Json::parse(text);
  } catch (const Json::parse_error& parse_error) {
    throw base::Error("{}: not valid JSON from byte {} of {}{}", source, parse_error.byte,
                      text.size(), parse_error.byte >= text.size() ? "; it was cut short" : "");
  } catch (const Json::out_of_range& range_error) {  // A number that no double holds.
    throw base::Error("{}: not valid JSON: {}", source, range_error.what());
  }
  const base::JsonObject reader(object, source, "");
  RequireFormat(reader);
  Result result;
  result.file = source;
  const base::JsonObject agent = reader.Object("agent");
  result.agent = agent.Text("name");
  result.kind = agent.Text("kind");
  result.course_set = reader.Text("course_set");
  result.set = ReadFigures(reader);
  (void)reader.Object("protocol").Get("collision_ends");
  for (const auto& [key, value] : reader.Get("protocol").items()) {
    result.protocol[key] = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  const base::JsonObject physics = reader.Object("physics");
  result.physics = physics.Text("name");
  result.physics_version = physics.Text("version");
  const base::JsonObject run = reader.Object("run");
  result.seed = run.Get("seed").is_number_integer() ? run.Get("seed").get<std::int64_t>() : 0;
  result.step = run.Number("step_s", 1e-6, 1e3);
  result.robot_length = run.Number("robot_length_m", 0.0, 100.0);
  result.robot_width = run.Number("robot_width_m", 0.0, 100.0);
  const base::JsonObject provenance = reader.Object("provenance");
  result.source = provenance.Text("source");
  result.collection = provenance.Text("collection");
  result.commit = provenance.Text("commit");
  result.settings = ReadSettings(provenance);
  result.training_overlap = ReadOverlap(provenance);
  for (const Json& profile : provenance.List("profiles")) {
    if (!profile.is_string()) provenance.Fail("a profile", profile, "a text");
    result.profiles.push_back(profile.get<std::string>());
  }
  const std::size_t num_courses = reader.List("courses").size();
  if (num_courses == 0) reader.Fail("courses", reader.List("courses"), "at least one course");
  for (std::size_t c = 0; c < num_courses; ++c) {
    result.courses.push_back(ReadCourse(reader.Element("courses", c), result.step));
  }
  result.drawn = ReadDrawn(reader, result);
  RequireConsistent(result, reader);
  const base::JsonObject files = reader.Object("files");
  return {std::move(result), fs::path(files.Text("courses")).filename().string(),
          fs::path(files.Text("tracks")).filename().string()};
}

Result ReadResult(const fs::path& path) {
  std::error_code error;
  const fs::path file = fs::is_directory(path, error) ? path / kEvaluationFile : path;
  auto [result, courses_file, tracks_file] = ParseResult(base::ReadTextFile(file), file.string());
  const fs::path directory = file.parent_path();
  ReadCoursesAndTracks(directory / courses_file, directory / tracks_file, result);
  return std::move(result);
}

void RequireSameProtocol(std::span<const Result> results) {
  for (const Result& result : results.subspan(std::min<std::size_t>(1, results.size()))) {
    const Result& first = results.front();
    for (const auto& [key, value] : first.protocol) {
      const auto it = result.protocol.find(key);
      const std::string other = it == result.protocol.end() ? "missing" : it->second;
      if (other == value) continue;
      throw base::Error(
          "{} and {} cannot stand in one report: {} of the protocol is {} in the first and {} in "
          "the second",
          first.file, result.file, key, value, other);
    }
  }
}

namespace {

using OrderedJson = nlohmann::ordered_json;

std::string PrintCompactly(const OrderedJson& json) {
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
}

OrderedJson CompactCourse(const ResultCourse& course, double step) {
  std::string outcomes;
  OrderedJson times = OrderedJson::array();
  OrderedJson steps = OrderedJson::array();
  OrderedJson collisions = OrderedJson::array();
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
  OrderedJson json = {
      {"course", course.name}, {"optimal_time_s", course.optimal_time}, {"outcomes", outcomes}};
  json[are_steps ? "steps" : "times_s"] = std::move(are_steps ? steps : times);
  if (!are_implied) json["collisions_per_episode"] = std::move(collisions);
  return json;
}

}  // namespace

std::string CompactResult(std::string_view text, const std::string& source) {
  const Result result = ParseResult(text, source).result;
  const OrderedJson full = OrderedJson::parse(text);
  std::string compact = "{\n";
  for (const auto& [key, value] : full.items()) {
    if (key == "courses" || key == "drawn") continue;
    OrderedJson kept = value;
    if (key == "provenance") {
      kept.erase("config");
      // Paths on the machine that drove: only their last parts are kept.
      for (const char* path : {"source", "collection"}) {
        kept[path] = std::filesystem::path(kept[path].get<std::string>()).filename().string();
      }
    }
    compact += PrintCompactly(key) + ": " + PrintCompactly(kept) + ",\n";
  }
  compact += "\"courses\": [\n";
  for (const ResultCourse& course : result.courses) {
    if (&course != &result.courses.front()) compact += ",\n";
    compact += PrintCompactly(CompactCourse(course, result.step));
  }
  return compact + "\n]\n}\n";
}

}  // namespace slalom::eval
