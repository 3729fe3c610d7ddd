#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "base/parallel.h"
#include "env/agent.h"
#include "sim/environments.h"

namespace slalom::eval {

/// The oracle's name beside those of planners.
inline constexpr std::string_view kOracle = "oracle";

/// Drives with what no robot can know: the map, the robot's true pose and speed, how obstacles will
/// move, and how this robot answers to each command. It is no method to compare with, but says how
/// much of a set of courses can be driven at all.
///
/// In each control step it drives copies of the simulated robot through sequences of commands, in
/// the task's own physics, and commands the first of the best sequence (cross-entropy method;
/// Rubinstein 1999). The best arrives first, or is nearest to the goal, by a way clear of fixed
/// obstacles, when the sequence ends; a sequence that collides is the worse the sooner it does.
///
/// An episode is the same at any index of any batch and on any number of threads. Confined to one
/// thread at a time. Cost: about 2 ms for a command.
class OracleAgent : public env::Agent {
 public:
  /// Keeps a reference to the environments that it drives, which must outlive it, as must
  /// `parallel`, which may be null (`sim::CourseEnvironments`). Throws `base::Error` if their
  /// robots are not those of Slalom's own physics, which alone can be copied.
  OracleAgent(const sim::CourseEnvironments& environments, base::ParallelFor* parallel);
  ~OracleAgent() override;

  /// Looks at the environments, and of the observations only at which episodes begin and end.
  void Act(const env::ObservationBatch& observations, std::span<float> actions) override;

 private:
  class Driver;

  base::ParallelFor* const parallel_;
  std::vector<std::unique_ptr<Driver>> drivers_;  // [B]
};

}  // namespace slalom::eval
