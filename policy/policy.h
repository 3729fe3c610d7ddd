#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "env/action.h"
#include "env/observation.h"
#include "policy/mlp_shape.h"
#include "policy/network_config.h"
#include "policy/safetensors.h"

namespace slalom::policy {

/// What a policy sees, is and commands. A value.
struct PolicySpec {
  env::ObservationSpec observation;
  NetworkConfig network;
  env::ActionBounds actions;

  MlpShape actor_shape()
      const;  ///< Throws `base::Error` where the sectors do not divide the beams.
};

/// A deterministic policy at one moment of its training. A value; the weights are shared and never
/// change.
struct PolicySnapshot {
  std::int64_t version = 0;  ///< Rises with each snapshot that a learner gives out.
  PolicySpec spec;
  std::shared_ptr<const std::vector<float>> weights;  ///< [spec.actor_shape().num_parameters()]
};

struct LoadedPolicy {
  PolicySnapshot snapshot;
  Metadata metadata;  ///< As given to `PrintPolicy`.
};

/// A policy as the bytes of a safetensors file, which is also how it travels in messages: tensors
/// "actor.encoder.0.weight" and so on, and `metadata` (config, commit, seed, steps, ...) beside the
/// spec.
std::string PrintPolicy(const PolicySnapshot& snapshot, const Metadata& metadata);

/// Throws `base::Error` that begins with `source` where the bytes, which anybody may have sent, are
/// cut short, damaged or no policy of this program, or a weight is not finite. Allocates a few
/// times their size.
LoadedPolicy ParsePolicy(std::span<const std::byte> bytes, std::string_view source);

/// Saves a policy as a file. Throws `base::Error` where it cannot be written.
void SavePolicy(const std::filesystem::path& path, const PolicySnapshot& snapshot,
                const Metadata& metadata);

/// Throws `base::Error` naming the file where it is missing, or as `ParsePolicy`.
LoadedPolicy LoadPolicy(const std::filesystem::path& path);

/// Throws `base::Error` naming `source`, the policy's file, where a policy of `spec` cannot drive
/// on `observation` with `actions`.
void RequireSameInterface(const std::string& source, const PolicySpec& spec,
                          const env::ObservationSpec& observation,
                          const env::ActionBounds& actions);

}  // namespace slalom::policy
