#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "base/parallel.h"
#include "base/result.h"
#include "eval/evaluation.h"
#include "eval/service/evaluator_service_config.h"
#include "eval/service/score_log.h"
#include "metrics/registry.h"
#include "proto/policy_link.h"
#include "proto/replay_link.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"

namespace slalom::eval {

/// The identity of an evaluator process and the servers it connects to.
struct EvaluatorIdentity {
  std::string name;
  std::filesystem::path state_directory;  ///< Holds scores.csv and best.safetensors.
  std::uint64_t spec_hash = 0;
  std::string course_set;
  transport::ClientOptions replay;
  transport::ClientOptions learner;
};

/// Follows the policies that the learner would save and scores them on courses, one after the
/// other, always the newest. Writes a line of scores.csv for each and shows it as metrics. Keeps
/// the best policy on this course set as best.safetensors, also across restarts. If the disk is
/// full, the error is logged and that line or file is lost. Confined to the thread that made it.
class EvaluatorService {
 public:
  /// Reads a policy file's bytes. Returns a function that makes agents of the policy, or the reason
  /// why it cannot.
  using ReadPolicy = std::function<base::Result<MakeAgent>(std::span<const std::byte> policy)>;

  /// `parallel` must outlive it. Throws `base::Error` if the directory cannot be written.
  EvaluatorService(const EvaluatorServiceConfig& config, EvaluationTask task,
                   EvaluatorIdentity identity, ReadPolicy read_policy, base::ParallelFor& parallel,
                   transport::Context& context, metrics::Registry& registry);

  /// Works until `stop`. Throws `base::Error` if a server refuses this process for good, or if a
  /// policy is of another spec.
  void Run(std::stop_token stop);

 private:
  /// Keeps the connections alive.
  void Listen();
  void Score(std::stop_token stop);
  void Record(const Evaluation& evaluation, std::int64_t version, double seconds, bool kept);
  proto::Report MakeReport() const;

  /// Saves the policy if it scored better than all that were saved before. Returns whether it did.
  bool KeepBest(std::string_view policy, double success_rate);

  std::filesystem::path best() const { return identity_.state_directory / "best.safetensors"; }

  const EvaluatorServiceConfig config_;
  const EvaluationTask task_;
  const EvaluatorIdentity identity_;
  const ReadPolicy read_policy_;
  base::ParallelFor& parallel_;
  metrics::Registry& registry_;
  ScoreLog scores_;
  service::ReplayLink replay_;
  service::PolicyLink policy_;

  std::string newest_;  ///< Bytes of the newest policy file.
  std::int64_t scored_version_ = -1;
  std::int64_t num_scored_ = 0;
  double success_rate_ = 0.0;
  double best_success_rate_ = -1.0;
};

}  // namespace slalom::eval
