#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>

#include "base/append_file.h"
#include "run/event_file.h"

namespace slalom::run {

/// One row of `metrics.csv`, and what the progress line shows. Rates are over the time since the
/// last row; statistics of episodes are over the actor's most recent episodes. NaN: not known yet
/// (an empty cell).
struct MetricsRow {
  double training_s = 0.0;  ///< Time spent training (`TrainingClock`), over all sessions, [s].
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  std::int64_t episodes = 0;
  double steps_per_s = 0.0;
  double updates_per_s = 0.0;
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_episode_steps = 0.0;
  double critic_loss = 0.0;
  double mean_q = 0.0;   ///< Of the critics for replayed actions, in scaled rewards.
  double actor_q = 0.0;  ///< Of the first critic for the actor's own actions.
  double critic_gradient_norm = 0.0;
  double actor_gradient_norm = 0.0;
  std::int64_t replay_steps = 0;

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double entropy = kNone;      ///< Of a stochastic policy, [nats].
  double temperature = kNone;  ///< SAC's alpha.
  double cost_q = kNone;       ///< Mean of the cost critics, [discounted collisions].
  double multiplier = kNone;   ///< lambda of a constraint.
  double violation = kNone;    ///< Collisions per episode above the constraint's limit.
  double model_loss = kNone;   ///< Of a transition model, on its training batches.
  /// Of the transition model on held-out transitions, in this order: root mean squared error per
  /// feature, the same error of a model that predicts no change, negative log-likelihood per
  /// feature, error of the scaled reward, cross-entropy of termination [nats], and the shares of
  /// numbers inside the central 50 % and 90 % of the prediction.
  double model_error = kNone;
  double model_change = kNone;
  double model_likelihood = kNone;
  double model_reward_error = kNone;
  double model_termination = kNone;
  double model_inside_50 = kNone;
  double model_inside_90 = kNone;
  double model_steps_error = kNone;  ///< As `model_error`, five steps ahead, on what was replayed.
};

/// Returns the row as a progress line. `remaining_s`: time left, [s]; negative: not known.
std::string FormatProgress(const MetricsRow& row, double remaining_s);

/// Appends rows to `metrics.csv`, each written at once, so that a killed run keeps what it had, and
/// to a TensorBoard event file beside it (`EventFile`): every column as a scalar
/// "training/COLUMN". Confined to one thread.
class MetricsLog {
 public:
  /// Opens or makes the file. Rows after `keep_until_step` are dropped first: a resumed run writes
  /// them anew, and its event file supersedes them. Throws `base::Error` if a file cannot be
  /// written.
  MetricsLog(const std::filesystem::path& path, std::int64_t keep_until_step);

  /// Appends a row. One that cannot be written is left out as a whole, and the first of several
  /// such rows is logged: a full disk does not end the training.
  void Append(const MetricsRow& row);

 private:
  std::optional<base::AppendFile> file_;
  std::optional<EventFile> events_;
  bool failing_ = false;
};

}  // namespace slalom::run
