#include "app/train/line_driver.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "app/train/agent_run_config.h"
#include "app/train/guarded.h"
#include "app/train/profile.h"
#include "app/train/scoring.h"
#include "base/config.h"
#include "base/error.h"
#include "base/json.h"
#include "base/log.h"
#include "env/state_layout.h"
#include "planners/localisation/scan_matching_agent.h"
#include "planners/planner_agent.h"
#include "sim/environments.h"
#include "sim/lidar.h"

namespace slalom::train {
namespace {

using json = nlohmann::json;

// Limits of a guard's maps, [m].
constexpr double kFarthestGoal = 100.0;
constexpr double kFarthestPose = 1e5;

/// Numbers that Python's `json.dumps` writes though JSON has none such.
constexpr std::array<std::string_view, 3> kNonFinite = {"NaN", "Infinity", "-Infinity"};

/// The line with quotes around these numbers, so that it is JSON.
std::string QuoteNonFinite(std::string_view line) {
  std::string quoted;
  bool in_text = false;
  while (!line.empty()) {
    const auto* const name = std::ranges::find_if(
        kNonFinite, [&](std::string_view each) { return line.starts_with(each); });
    const bool quotes = !in_text && name != kNonFinite.end();
    const std::string_view next = line.substr(0, quotes ? name->size() : 1);
    if (next == "\"") in_text = !in_text;
    quoted += quotes ? fmt::format("\"{}\"", next) : std::string(next);
    line.remove_prefix(next.size());
  }
  return quoted;
}

bool IsNonFinite(const json& value) {
  return value.is_string() && std::ranges::count(kNonFinite, value.get_ref<const std::string&>());
}

/// A number, which need not be finite, or nothing.
std::optional<double> NumberOf(const json& value) {
  if (value.is_number()) return value.get<double>();
  if (!IsNonFinite(value)) return std::nullopt;
  return std::strtod(value.get_ref<const std::string&>().c_str(), nullptr);
}

/// A value as its line has it.
std::string Shown(const json& value) {
  return IsNonFinite(value) ? value.get<std::string>() : value.dump();
}

/// Lays profiles and overrides over `config`. `reads`: whether a key is one that an override may
/// set; `expected` says which.
template <class Config, class Reads>
void LayOver(const LineDriverOptions& options, Config& config, const Reads& reads,
             std::string_view expected) {
  for (const std::string& file : options.profiles) {
    LayProfile(file, config.environment, config.guard);
  }
  const config::FieldList fields = config::ListFields(config);
  for (const std::string& assignment : options.overrides) {
    if (!reads(assignment)) {
      throw base::Error(fmt::format("--set {}: expected a key of {}", assignment, expected));
    }
    config::ApplyOverride(assignment, fields);
  }
}

bool IsRobots(std::string_view assignment) {
  return assignment.starts_with("guard.") || assignment.starts_with("environment.");
}

/// Throws `base::Error` if a robot is described, but no guard reads it.
void RequireGuard(const LineDriverOptions& options) {
  std::string unread = options.profiles.empty() ? "" : "--profile " + options.profiles.front();
  for (const std::string& assignment : options.overrides) {
    if (unread.empty() && !assignment.starts_with("guard.")) unread = "--set " + assignment;
  }
  if (unread.empty()) return;
  throw base::Error(fmt::format(
      "{}: expected --set guard.shield=true, guard.waypoints=true or guard.scan_matching=true as "
      "well, as only a guard reads it",
      unread));
}

/// Repeats a command, for a guard that checks it.
class RepeatingAgent : public env::Agent {
 public:
  env::Action& command() { return command_; }
  void Act(const env::ObservationBatch&, std::span<float> actions) override {
    std::ranges::copy(env::NumbersOf(std::span(&command_, 1)), actions.begin());
  }

 private:
  env::Action command_;
};

json Parse(std::string_view line) {
  json given = base::ParseJson(QuoteNonFinite(line));
  if (!given.is_object()) {
    throw base::Error(
        fmt::format("found {}, expected a JSON object: {{\"ranges\": [...], \"goal\": [x, y]}}",
                    given.is_discarded() ? "no JSON" : given.type_name()));
  }
  return given;
}

bool First(const json& given) {
  const auto it = given.find("first");
  if (it == given.end()) return false;
  if (!it->is_boolean()) throw base::Error("first: expected true or false");
  return it->get<bool>();
}

/// The list of this key, which has `size` members.
const json& List(const json& given, std::string_view key, std::size_t size) {
  const auto it = given.find(key);
  if (it == given.end()) {
    throw base::Error(fmt::format("{}: is missing, expected {} numbers", key, size));
  }
  if (!it->is_array()) throw base::Error(fmt::format("{}: expected {} numbers", key, size));
  if (it->size() != size) {
    throw base::Error(fmt::format("{}: found {} numbers, expected {}", key, it->size(), size));
  }
  return *it;
}

std::vector<double> Numbers(const json& given, std::string_view key, std::size_t size) {
  std::vector<double> numbers;
  for (const json& element : List(given, key, size)) {
    numbers.push_back(NumberOf(element).value_or(NAN));
    if (std::isfinite(static_cast<float>(numbers.back()))) continue;
    throw base::Error(fmt::format("{}[{}]: found {}, expected a number", key, numbers.size() - 1,
                                  Shown(element)));
  }
  return numbers;
}

void RequireNear(const char* key, base::Vec2 p, double reach, const char* of) {
  if (base::Norm(p) <= reach) return;
  throw base::Error(fmt::format("{}: found {:.6g} m, expected at most {:g} m from {}", key,
                                base::Norm(p), reach, of));
}

/// The range by which the sensor marks that there is no echo; NaN, which equals none, if the line
/// does not tell.
double NoEcho(const json& given) {
  const auto it = given.find("no_echo");
  if (it == given.end()) return NAN;
  if (it->is_number()) return it->get<double>();
  throw base::Error(fmt::format(
      "no_echo: found {}, expected the number that stands for no echo in ranges", Shown(*it)));
}

/// The range that a reading means, as ROS reads it (REP 117), or nothing if it means none: NaN
/// and infinity are no echo, minus infinity is an obstacle too near to be measured. [m]
std::optional<double> RangeOf(const json& reading, double no_echo) {
  if (reading.is_null()) return INFINITY;
  const std::optional<double> number = NumberOf(reading);
  if (!number) return std::nullopt;
  if (std::isnan(*number) || *number == no_echo) return INFINITY;
  if (*number == -INFINITY) return 0.0;
  if (*number < 0.0) return std::nullopt;
  return number;
}

}  // namespace

LineDriver::LineDriver(const LineDriverOptions& options, const MakeLineAgent& make_agent) {
  if (!options.policy.empty()) {
    LoadPolicy(options, make_agent);
  } else if (!options.planner.empty()) {
    MakePlanner(options);
  } else {
    MakeCheck(options);
  }
  matching_ = dynamic_cast<const planners::ScanMatchingAgent*>(agent_.get());
  observations_.Resize(1, observed_.num_beams, observed_.state_size);
  last_.resize(static_cast<std::size_t>(observed_.commands));
  if (command_ != nullptr) {
    keys_.insert(keys_.end(), {"command", "speeds"});
  } else {
    for (const env::StateField& field : env::kStateFields) {
      if (field.source == env::StateSource::kSensors) keys_.emplace_back(field.name);
    }
  }
  keys_.insert(keys_.end(), {"first", "last_action", "no_echo", "pose"});
}

LineDriver::~LineDriver() = default;

void LineDriver::LoadPolicy(const LineDriverOptions& options, const MakeLineAgent& make_agent) {
  const std::string& file = options.policy;
  policy::LoadedPolicy loaded = policy::LoadPolicy(file);
  const policy::PolicySpec spec = loaded.snapshot.spec;
  spec.RequireCourses(file);
  if (spec.observation.privileged) {
    throw base::Error(fmt::format(
        "{}: the policy sees what no sensor tells (environment.observation.privileged), expected "
        "one that can drive outside a simulator",
        file));
  }
  const auto trained = TrainedConfig(loaded.metadata, file);
  RunConfig config = trained.value_or(RunConfig{});
  LayOver(options, config, IsRobots, "[guard], or of [environment] for the robot that it guards");
  is_guarded_ = config.guard.guards();
  reads_odometry_ = config.guard.enabled() || spec.observation.tracked;
  has_map_ = config.guard.waypoints;
  if (reads_odometry_) {
    sim::CheckConsistent(config.environment);
    policy::RequireSameInterface(file, spec, sim::MakeObservationSpec(config.environment),
                                 config.environment.action);
    if (trained) RequireSameFieldOfView(file, trained->environment, config.environment);
  } else {
    RequireGuard(options);
  }
  environment_ = config.environment;
  observed_ = spec.observation;
  bounds_ = spec.actions;
  if (observed_.tracked) {
    tracker_.emplace(sim::ScanGeometryOf(environment_), environment_.episode.step);
  }
  agent_ = Guarded(make_agent(std::move(loaded.snapshot), config), config.guard, environment_);
}

void LineDriver::MakePlanner(const LineDriverOptions& options) {
  const std::string& name = options.planner;
  const AgentRunConfig config = ResolveAgentRun([&](AgentRunConfig& defaults) {
    LayOver(
        options, defaults,
        [&](std::string_view assignment) {
          if (IsRobots(assignment)) return true;
          return assignment.starts_with("navigation.") || assignment.starts_with(name + ".");
        },
        fmt::format("[guard], [environment], [navigation] or [{}]", name));
  });
  is_guarded_ = config.guard.guards();
  reads_odometry_ = has_map_ = true;
  environment_ = config.environment;
  sim::CheckConsistent(environment_);
  observed_ = sim::MakeObservationSpec(environment_);
  bounds_ = environment_.action;
  agent_ = Guarded(std::make_unique<planners::PlannerAgent>(
                       name, config.planners, sim::ScanGeometryOf(environment_), bounds_,
                       environment_.episode.step, /*parallel=*/nullptr),
                   config.guard, environment_);
}

void LineDriver::MakeCheck(const LineDriverOptions& options) {
  RunConfig config;
  config.guard.shield = true;
  LayOver(options, config, IsRobots, "[guard], or of [environment] for the robot that it guards");
  if (!config.guard.shield) {
    throw base::Error(
        "guard.shield: found false, expected true, as there is nothing else that checks commands");
  }
  config.guard.waypoints = config.guard.scan_matching = false;  // They belong to what drives.
  is_guarded_ = reads_odometry_ = true;
  environment_ = config.environment;
  sim::CheckConsistent(environment_);
  observed_ = sim::MakeObservationSpec(environment_);
  bounds_ = environment_.action;
  auto repeats = std::make_unique<RepeatingAgent>();
  command_ = &repeats->command();
  agent_ = Guarded(std::move(repeats), config.guard, environment_);
}

std::string LineDriver::Answer(std::string_view line) {
  const json given = Parse(line);
  for (const auto& [key, value] : given.items()) {
    if (std::ranges::count(keys_, key) == 0) {
      throw base::Error(fmt::format("no key '{}', expected {}", key, fmt::join(keys_, ", ")));
    }
  }
  observations_.first[0] = is_new_ || First(given);
  if (observations_.first[0]) std::ranges::fill(last_, bounds_.Standstill());
  ReadRanges(given);
  if (reads_odometry_) ReadOdometry(given);
  if (command_ != nullptr) {
    const std::vector<double> speeds = Numbers(given, "command", env::kActionSize);
    *command_ = bounds_.Normalise(speeds[0], speeds[1]);
  } else {
    ReadState(given);
  }
  std::shift_right(last_.begin(), last_.end(), 1);
  env::Action& action = last_.front();
  agent_->Act(observations_, env::NumbersOf(std::span(&action, 1)));
  is_new_ = false;
  json answer = {{"linear", bounds_.linear_mps(action)},
                 {"angular", bounds_.angular_radps(action)},
                 {"action", {action.linear, action.angular}}};
  if (is_guarded_) answer["guarded"] = agent_->Intervened(0);
  if (matching_ != nullptr) {
    const base::Pose2& X_OR = matching_->shown().odometry[0].X_OR;
    const base::Vec2 p_W = base::Transform(X_WO_, X_OR.p);
    answer["pose"] = {p_W.x, p_W.y, base::WrapAngle(X_WO_.yaw + X_OR.yaw)};
  }
  return answer.dump();
}

std::string LineDriver::Needs() const {
  std::set<std::string_view> keys = {"ranges"};
  if (reads_odometry_) keys.insert({"pose", "speeds"});
  if (command_ != nullptr) keys.insert("command");
  for (const env::StateField& field : env::kStateFields) {
    const bool is_read = command_ == nullptr && field.source == env::StateSource::kSensors;
    if (is_read && field.num_items(observed_) > 0) keys.insert(field.name);
  }
  return json{{"keys", keys},
              {"num_beams", observed_.num_beams},
              {"field_of_view", environment_.lidar.field_of_view},
              {"range_clip", observed_.range_clip},
              {"step", environment_.episode.step},
              {"bounds",
               {{"linear_min", bounds_.linear_min},
                {"linear_max", bounds_.linear_max},
                {"angular_max", bounds_.angular_max}}}}
      .dump();
}

void LineDriver::ReadState(const json& given) {
  const std::span<float> state = observations_.mutable_state(0);
  const env::StateWriter writer(observed_, bounds_);
  for (std::size_t i = 0; i < std::size(env::kStateFields); ++i) {
    const env::StateField& field = env::kStateFields[i];
    if (field.source != env::StateSource::kSensors) continue;
    if (field.num_items(observed_) == 0) continue;
    writer.Write(i, Numbers(given, field.name, field.numbers.size()), state);
  }
  if (has_map_) {
    RequireNear("goal", {state[0], state[1]}, kFarthestGoal,
                "the robot (guard.waypoints, or a planner)");
  }
  if (given.contains("last_action")) {
    const std::vector<double> action = Numbers(given, "last_action", env::kActionSize);
    last_.front() = {static_cast<float>(action[0]), static_cast<float>(action[1])};
  }
  const std::span<const float> actions = env::NumbersOf(last_);
  writer.Write(env::FieldOf("last action"), actions.first(env::kActionSize), state);
  writer.Write(env::FieldOf("earlier action"), actions.subspan(env::kActionSize), state);
  if (!tracker_) return;
  const base::Pose2& X_OR = observations_.odometry[0].X_OR;
  if (observations_.first[0]) tracker_->Reset();
  tracker_->Update(observations_.frame(0).ranges_cm, X_OR);
  writer.Write(env::FieldOf("tracked obstacle"), tracker_->Observe(X_OR), state);
}

/// Whatever frame the robot knows its pose in, a guard gets it in that of the first pose.
void LineDriver::ReadOdometry(const json& given) {
  const std::vector<double> pose = Numbers(given, "pose", 3);
  const std::vector<double> speeds = Numbers(given, "speeds", 2);
  const base::Pose2 X_WR = {{pose[0], pose[1]}, std::remainder(pose[2], 2.0 * base::kPi)};
  if (observations_.first[0]) X_WO_ = X_WR;
  const base::Pose2 X_OR = {base::InverseTransform(X_WO_, X_WR.p),
                            base::WrapAngle(X_WR.yaw - X_WO_.yaw)};
  RequireNear("pose", X_OR.p, kFarthestPose, "the first pose of the episode");
  observations_.odometry[0] = {X_OR, speeds[0], speeds[1]};
}

/// Metres become the centimetres that a policy sees.
void LineDriver::ReadRanges(const json& given) {
  const double clip = observed_.range_clip;
  const std::span<std::uint16_t> ranges = observations_.mutable_ranges(0);
  const json& list = List(given, "ranges", ranges.size());
  const double no_echo = NoEcho(given);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const std::optional<double> range = RangeOf(list[i], no_echo);
    if (!range) {
      throw base::Error(
          fmt::format("ranges[{}]: found {}, expected metres, 0 or more, or null for no echo", i,
                      Shown(list[i])));
    }
    if (list[i] == 0.0 && !given.contains("no_echo")) WarnOfZero(i);
    ranges[i] =
        static_cast<std::uint16_t>(std::min(std::rint(100.0 * std::min(*range, clip)), 65535.0));
  }
}

/// Many sensors mean no echo by 0, at which a policy would brake as at a wall.
void LineDriver::WarnOfZero(std::size_t i) {
  if (std::exchange(warned_of_zero_, true)) return;
  spdlog::warn(
      "ranges[{}] is 0, which counts as an obstacle at the sensor; if the sensor means no echo "
      "by it, add \"no_echo\": 0 to each line",
      i);
}

}  // namespace slalom::train
