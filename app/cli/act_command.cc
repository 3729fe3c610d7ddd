#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/cli/commands.h"
#include "app/train/run_config.h"
#include "base/error.h"
#include "base/json.h"
#include "env/observation.h"
#include "policy/policy_agent.h"

namespace slalom::cli {
namespace {

/// One robot that sends its observation on a line and reads its command on a line.
class LineDriver {
 public:
  using json = nlohmann::json;

  explicit LineDriver(const std::string& file) {
    policy::LoadedPolicy loaded = policy::LoadPolicy(file);
    loaded.snapshot.spec.RequireCourses(file);
    if (loaded.snapshot.spec.observation.privileged) {
      throw base::Error(fmt::format(
          "{}: the policy sees what no sensor tells (environment.observation.privileged), expected "
          "one that can drive outside a simulator",
          file));
    }
    const auto config = train::TrainedConfig(loaded.metadata, file).value_or(train::RunConfig{});
    agent_ = policy::MakePolicyAgent(std::move(loaded.snapshot), config.mpc,
                                     train::SeedOf(config, "act"));
    const env::ObservationSpec& seen = spec().observation;
    observations_.Resize(1, seen.num_beams, seen.state_size);
    last_.resize(static_cast<std::size_t>(seen.commands));
  }

  /// Throws `base::Error` that names the key and what was expected of it.
  json Answer(const std::string& line) {
    const json given = Parse(line);
    for (const auto& [key, value] : given.items()) {
      if (std::ranges::count(kKeys, key) == 0) {
        throw base::Error(fmt::format("no key '{}', expected {}", key, fmt::join(kKeys, ", ")));
      }
    }
    observations_.first[0] = is_new_ || First(given);
    if (observations_.first[0]) std::ranges::fill(last_, env::Action{});
    ReadRanges(given);
    const std::span<float> state = observations_.mutable_state(0);
    ReadNumbers(given, "goal", state.first(2));
    if (given.contains("last_action")) {
      ReadNumbers(given, "last_action", env::NumbersOf(std::span(last_).first(1)));
    }
    std::array<float, 2> speeds{};
    if (spec().observation.speeds) ReadNumbers(given, "speeds", speeds);
    std::array<float, 2> mounting{};
    if (spec().observation.mounting) ReadNumbers(given, "mounting", mounting);
    env::WriteMotion(spec().observation, last_, spec().actions.Scale(speeds[0], speeds[1]),
                     {mounting[0], mounting[1]}, state);
    std::shift_right(last_.begin(), last_.end(), 1);
    env::Action& action = last_.front();
    agent_->Act(observations_, env::NumbersOf(std::span(&action, 1)));
    is_new_ = false;
    return {{"linear", spec().actions.linear_mps(action)},
            {"angular", spec().actions.angular_radps(action)},
            {"action", {action.linear, action.angular}}};
  }

 private:
  static constexpr std::array<std::string_view, 6> kKeys = {"ranges", "goal",     "last_action",
                                                            "speeds", "mounting", "first"};

  const policy::PolicySpec& spec() const { return agent_->snapshot().spec; }

  static json Parse(const std::string& line) {
    json given = base::ParseJson(line);
    if (!given.is_object()) {
      throw base::Error("expected a JSON object: {\"ranges\": [...], \"goal\": [x, y]}");
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
  static const json& List(const json& given, const char* key, std::size_t size) {
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

  static void ReadNumbers(const json& given, const char* key, std::span<float> numbers) {
    const json& list = List(given, key, numbers.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      numbers[i] = list[i].is_number() ? list[i].get<float>() : NAN;
      if (std::isfinite(numbers[i])) continue;
      throw base::Error(fmt::format("{}[{}]: found {}, expected a number", key, i, list[i].dump()));
    }
  }

  /// Metres become the centimetres that a policy sees.
  void ReadRanges(const json& given) {
    const double clip = spec().observation.range_clip;
    const std::span<std::uint16_t> ranges = observations_.mutable_ranges(0);
    const json& list = List(given, "ranges", ranges.size());
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const double range = list[i].is_null()     ? clip
                           : list[i].is_number() ? list[i].get<double>()
                                                 : -1.0;
      if (!(range >= 0.0)) {
        throw base::Error(
            fmt::format("ranges[{}]: found {}, expected metres, 0 or more, or null for no echo", i,
                        list[i].dump()));
      }
      ranges[i] =
          static_cast<std::uint16_t>(std::min(std::rint(100.0 * std::min(range, clip)), 65535.0));
    }
  }

  std::unique_ptr<policy::PolicyAgent> agent_;
  env::ObservationBatch observations_;
  std::vector<env::Action> last_;  // The newest first, as many as are observed.
  bool is_new_ = true;
};

void Act(const std::string& policy) {
  LineDriver driver(policy);
  std::string line;
  for (std::int64_t number = 1; std::getline(std::cin, line); ++number) {
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
  auto policy = std::make_shared<std::string>();
  command->add_option("--policy", *policy, "Policy file (.safetensors)")
      ->required()
      ->check(CLI::ExistingFile);
  command->footer(
      "Each line of standard input is one step, and is answered by a line (docs/robot.md):\n\n"
      "  {\"ranges\": [2.31, null, ...], \"goal\": [3.0, 0.5]}      metres; null: no echo\n"
      "  {\"action\":[0.7,-0.1],\"angular\":-0.31,\"linear\":1.55}     m/s, rad/s\n\n"
      "\"first\": true begins an episode. \"last_action\": [a, b] is for a robot that did not do\n"
      "what it was told. \"speeds\": [m/s, rad/s] and \"mounting\": [x, y] in metres are for a "
      "policy\n"
      "that observes them.\n");
  command->callback([policy] { Act(*policy); });
}

}  // namespace slalom::cli
