#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/train/run_config.h"
#include "base/geometry.h"
#include "env/action.h"
#include "env/agent.h"
#include "env/observation.h"
#include "env/sensing/obstacle_tracker.h"
#include "planners/localisation/scan_matching_agent.h"
#include "policy/policy.h"
#include "sim/environment_config.h"

/// One robot outside the simulator (docs/robot.md): it sends what it senses on a line and reads its
/// command on a line. `slalom act` and the Python package drive by it.

namespace slalom::train {

/// What drives, and which guard and robot there are.
struct LineDriverOptions {
  /// A policy's file, or the name of a classical planner. Both empty: commands are checked that
  /// come with the lines.
  std::string policy, planner;
  std::vector<std::string> profiles;   ///< Files with [guard] and [environment].
  std::vector<std::string> overrides;  ///< "section.key=value" of these, and of a planner's own.
};

/// Makes the agent of a policy that was trained with this config.
using MakeLineAgent =
    std::function<std::unique_ptr<env::Agent>(policy::PolicySnapshot, const RunConfig&)>;

/// Drives one robot by a policy, a planner or commands of others, under a guard if the options or
/// the policy's training have one. Commands of others always have a shield, and no guide. Confined
/// to one thread at a time.
class LineDriver {
 public:
  /// Throws `base::Error` that names the file or the key.
  LineDriver(const LineDriverOptions& options, const MakeLineAgent& make_agent);
  ~LineDriver();

  /// Returns the answer to a line. Throws `base::Error` that names the key and what was expected of
  /// it. It may be called again then; the failed line counts for nothing, unless it was the first.
  std::string Answer(std::string_view line);

  /// Returns what the robot must send, and what it gets, as JSON: "keys" it needs, "num_beams",
  /// "field_of_view" [rad] and "range_clip" [m] of its scans, "step" [s] between two lines, the
  /// "bounds" of commands as in [environment.action].
  std::string Needs() const;

 private:
  void LoadPolicy(const LineDriverOptions& options, const MakeLineAgent& make_agent);
  void MakePlanner(const LineDriverOptions& options);
  void MakeCheck(const LineDriverOptions& options);
  void ReadState(const nlohmann::json& given);
  void ReadOdometry(const nlohmann::json& given);
  void ReadRanges(const nlohmann::json& given);
  void WarnOfZero(std::size_t i);

  sim::EnvironmentConfig environment_;
  env::ObservationSpec observed_;
  env::ActionBounds bounds_;
  bool reads_odometry_ = false;  // A guard, a planner or a tracker does.
  bool is_guarded_ = false;
  bool has_map_ = false;            // A planner or a guard that shows the way has one.
  env::Action* command_ = nullptr;  // Of others, which the agent only repeats.
  std::unique_ptr<env::Agent> agent_;
  const planners::ScanMatchingAgent* matching_ = nullptr;  // The agent, if it matches scans.
  std::optional<env::ObstacleTracker> tracker_;            // If the policy observes tracks.
  env::ObservationBatch observations_;
  base::Pose2 X_WO_;  // Where the episode began.
  std::vector<std::string_view> keys_ = {"ranges"};
  std::vector<env::Action> last_;  // The newest first, as many as are observed.
  bool is_new_ = true;
  bool warned_of_zero_ = false;
};

}  // namespace slalom::train
