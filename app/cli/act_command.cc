#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/train/guarded.h"
#include "app/train/profile.h"
#include "app/train/run_config.h"
#include "app/train/scoring.h"
#include "base/config.h"
#include "base/error.h"
#include "base/geometry.h"
#include "base/json.h"
#include "base/log.h"
#include "env/observation.h"
#include "policy/policy_agent.h"
#include "sim/environments.h"

namespace slalom::cli {
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

struct ActOptions {
  std::string policy;
  std::vector<std::string> profiles;
  std::vector<std::string> overrides;
};

/// Lays profiles and overrides over `config`, the config of the policy's training: a guard and its
/// robot. Throws `base::Error` for what nothing would read.
void LayOver(const ActOptions& options, train::RunConfig& config) {
  for (const std::string& file : options.profiles) {
    train::LayProfile(file, config.environment, config.guard);
  }
  std::string unread = options.profiles.empty() ? "" : "--profile " + options.profiles.front();
  const config::FieldList fields = config::ListFields(config);
  for (const std::string& assignment : options.overrides) {
    const bool is_guards = assignment.starts_with("guard.");
    if (!is_guards && !assignment.starts_with("environment.")) {
      throw base::Error(fmt::format(
          "--set {}: expected a key of [guard], or of [environment] for the robot that it guards",
          assignment));
    }
    config::ApplyOverride(assignment, fields);
    if (!is_guards && unread.empty()) unread = "--set " + assignment;
  }
  if (config.guard.enabled() || unread.empty()) return;
  throw base::Error(fmt::format(
      "{}: expected --set guard.shield=true or guard.waypoints=true as well, as only a guard reads "
      "it",
      unread));
}

/// One robot that sends its observation on a line and reads its command on a line.
class LineDriver {
 public:
  explicit LineDriver(const ActOptions& options) {
    const std::string& file = options.policy;
    policy::LoadedPolicy loaded = policy::LoadPolicy(file);
    loaded.snapshot.spec.RequireCourses(file);
    if (loaded.snapshot.spec.observation.privileged) {
      throw base::Error(fmt::format(
          "{}: the policy sees what no sensor tells (environment.observation.privileged), expected "
          "one that can drive outside a simulator",
          file));
    }
    const auto trained = train::TrainedConfig(loaded.metadata, file);
    train::RunConfig config = trained.value_or(train::RunConfig{});
    LayOver(options, config);
    spec_ = loaded.snapshot.spec;
    is_guarded_ = config.guard.enabled();
    shows_way_ = config.guard.waypoints;
    if (is_guarded_) {
      const sim::EnvironmentConfig& task = config.environment;
      sim::CheckConsistent(task);
      policy::RequireSameInterface(file, spec_, sim::MakeObservationSpec(task), task.action);
      if (trained) train::RequireSameFieldOfView(file, trained->environment, task);
    }
    agent_ = train::Guarded(policy::MakePolicyAgent(std::move(loaded.snapshot), config.mpc,
                                                    train::SeedOf(config, "act")),
                            config.guard, config.environment);
    const env::ObservationSpec& seen = spec_.observation;
    observations_.Resize(1, seen.num_beams, seen.state_size);
    last_.resize(static_cast<std::size_t>(seen.commands));
    for (const env::StateField& field : env::kStateFields) {
      if (field.source == env::StateSource::kSensors) keys_.emplace_back(field.name);
    }
    keys_.insert(keys_.end(), {"first", "last_action", "no_echo", "pose"});
  }

  /// Throws `base::Error` that names the key and what was expected of it.
  json Answer(const std::string& line) {
    const json given = Parse(line);
    for (const auto& [key, value] : given.items()) {
      if (std::ranges::count(keys_, key) == 0) {
        throw base::Error(fmt::format("no key '{}', expected {}", key, fmt::join(keys_, ", ")));
      }
    }
    observations_.first[0] = is_new_ || First(given);
    if (observations_.first[0]) std::ranges::fill(last_, spec_.actions.Standstill());
    ReadRanges(given);
    if (is_guarded_) ReadOdometry(given);
    const std::span<float> state = observations_.mutable_state(0);
    const env::StateWriter writer(spec_.observation, spec_.actions);
    for (std::size_t i = 0; i < std::size(env::kStateFields); ++i) {
      const env::StateField& field = env::kStateFields[i];
      if (field.source != env::StateSource::kSensors) continue;
      if (field.num_items(spec_.observation) == 0) continue;
      writer.Write(i, Numbers(given, field.name, field.numbers.size()), state);
    }
    if (shows_way_) {
      RequireNear("goal", {state[0], state[1]}, kFarthestGoal, "the robot (guard.waypoints)");
    }
    if (given.contains("last_action")) {
      const std::vector<double> action = Numbers(given, "last_action", env::kActionSize);
      last_.front() = {static_cast<float>(action[0]), static_cast<float>(action[1])};
    }
    const std::span<const float> actions = env::NumbersOf(last_);
    writer.Write(env::FieldOf("last action"), actions.first(env::kActionSize), state);
    writer.Write(env::FieldOf("earlier action"), actions.subspan(env::kActionSize), state);
    std::shift_right(last_.begin(), last_.end(), 1);
    env::Action& action = last_.front();
    agent_->Act(observations_, env::NumbersOf(std::span(&action, 1)));
    is_new_ = false;
    json answer = {{"linear", spec_.actions.linear_mps(action)},
                   {"angular", spec_.actions.angular_radps(action)},
                   {"action", {action.linear, action.angular}}};
    if (is_guarded_) answer["guarded"] = agent_->Intervened(0);
    return answer;
  }

 private:
  static json Parse(const std::string& line) {
    json given = base::ParseJson(QuoteNonFinite(line));
    if (!given.is_object()) {
      throw base::Error(
          fmt::format("found {}, expected a JSON object: {{\"ranges\": [...], \"goal\": [x, y]}}",
                      given.is_discarded() ? "no JSON" : given.type_name()));
    }
    return given;
  }

  static bool First(const json& given) {
    const auto it = given.find("first");
    if (it == given.end()) return false;
    if (!it->is_boolean()) throw base::Error("first: expected true or false");
    return it->get<bool>();
  }

  /// The list of this key, which has `size` members.
  static const json& List(const json& given, std::string_view key, std::size_t size) {
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

  static std::vector<double> Numbers(const json& given, std::string_view key, std::size_t size) {
    std::vector<double> numbers;
    for (const json& element : List(given, key, size)) {
      numbers.push_back(NumberOf(element).value_or(NAN));
      if (std::isfinite(static_cast<float>(numbers.back()))) continue;
      throw base::Error(fmt::format("{}[{}]: found {}, expected a number", key, numbers.size() - 1,
                                    Shown(element)));
    }
    return numbers;
  }

  /// Whatever frame the robot knows its pose in, a guard gets it in that of the first pose.
  void ReadOdometry(const json& given) {
    const std::vector<double> pose = Numbers(given, "pose", 3);
    const std::vector<double> speeds = Numbers(given, "speeds", 2);
    const base::Pose2 X_WR = {{pose[0], pose[1]}, std::remainder(pose[2], 2.0 * base::kPi)};
    if (observations_.first[0]) X_WO_ = X_WR;
    const base::Pose2 X_OR = {base::InverseTransform(X_WO_, X_WR.p),
                              base::WrapAngle(X_WR.yaw - X_WO_.yaw)};
    RequireNear("pose", X_OR.p, kFarthestPose, "the first pose of the episode");
    observations_.odometry[0] = {X_OR, speeds[0], speeds[1]};
  }

  static void RequireNear(const char* key, base::Vec2 p, double reach, const char* of) {
    if (base::Norm(p) <= reach) return;
    throw base::Error(fmt::format("{}: found {:.6g} m, expected at most {:g} m from {}", key,
                                  base::Norm(p), reach, of));
  }

  /// Metres become the centimetres that a policy sees.
  void ReadRanges(const json& given) {
    const double clip = spec_.observation.range_clip;
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

  /// The range by which the sensor marks that there is no echo; NaN, which equals none, if the line
  /// does not tell.
  static double NoEcho(const json& given) {
    const auto it = given.find("no_echo");
    if (it == given.end()) return NAN;
    if (it->is_number()) return it->get<double>();
    throw base::Error(fmt::format(
        "no_echo: found {}, expected the number that stands for no echo in ranges", Shown(*it)));
  }

  /// The range that a reading means, as ROS reads it (REP 117), or nothing if it means none: NaN
  /// and infinity are no echo, minus infinity is an obstacle too near to be measured. [m]
  static std::optional<double> RangeOf(const json& reading, double no_echo) {
    if (reading.is_null()) return INFINITY;
    const std::optional<double> number = NumberOf(reading);
    if (!number) return std::nullopt;
    if (std::isnan(*number) || *number == no_echo) return INFINITY;
    if (*number == -INFINITY) return 0.0;
    if (*number < 0.0) return std::nullopt;
    return number;
  }

  /// Many sensors mean no echo by 0, at which a policy would brake as at a wall.
  void WarnOfZero(std::size_t i) {
    if (std::exchange(warned_of_zero_, true)) return;
    spdlog::warn(
        "ranges[{}] is 0, which counts as an obstacle at the sensor; if the sensor means no echo "
        "by it, add \"no_echo\": 0 to each line",
        i);
  }

  policy::PolicySpec spec_;
  bool is_guarded_ = false;
  bool shows_way_ = false;  // The guard.
  std::unique_ptr<env::Agent> agent_;
  env::ObservationBatch observations_;
  base::Pose2 X_WO_;  // Where the episode began.
  std::vector<std::string_view> keys_ = {"ranges"};
  std::vector<env::Action> last_;  // The newest first, as many as are observed.
  bool is_new_ = true;
  bool warned_of_zero_ = false;
};

void Act(const ActOptions& options) {
  LineDriver driver(options);
  std::string line;
  for (std::int64_t number = 1; std::getline(std::cin, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      fmt::print("{}\n", driver.Answer(line).dump());
    } catch (const base::Error& error) {
      throw base::Error(fmt::format("standard input: line {}: {}", number, error.what()));
    }
    if (std::fflush(stdout) != 0) throw base::Error("standard output: nobody reads it any more");
  }
}

}  // namespace

void AddActCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "act", "Drive by a policy: reads what a robot senses as JSON lines, writes its commands");
  auto options = std::make_shared<ActOptions>();
  command->add_option("--policy", options->policy, "Policy file (.safetensors)")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option(
          "--profile", options->profiles,
          "Lay [guard] and [environment], the robot that is guarded, of this TOML file over "
          "those of the training (repeatable), for example configs/guarded.toml")
      ->type_name("FILE");
  command
      ->add_option("--set", options->overrides,
                   "Override a key of [guard] or [environment]: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  std::string more;
  for (const env::StateField& field : env::kStateFields) {
    if (field.source != env::StateSource::kSensors || field.num_items({}) > 0) continue;
    more += fmt::format(", \"{}\": [{}]", field.name, field.unit);
  }
  command->footer(
      "Each line of standard input is one step, and is answered by a line (docs/robot.md):\n\n"
      "  {\"ranges\": [2.31, null, ...], \"goal\": [3.0, 0.5]}      metres; null: no echo\n"
      "  {\"action\":[0.7,-0.1],\"angular\":-0.31,\"linear\":1.55}     m/s, rad/s\n\n"
      "NaN and Infinity are no echo, too. 0 is an obstacle at the sensor, unless \"no_echo\": 0 "
      "says\nthat the sensor means no echo by it.\n\n"
      "\"first\": true begins an episode. \"last_action\": [a, b] is for a robot that did not do\n"
      "what it was told. A policy may need more" +
      more +
      ".\n\n"
      "A guard (--profile, --set; docs/safety.md) needs \"pose\": [m, m, rad], in any frame that\n"
      "stays where it is, and \"speeds\". It answers whether it changed the action: "
      "\"guarded\":false.\n");
  command->callback([options] { Act(*options); });
}

}  // namespace slalom::cli
