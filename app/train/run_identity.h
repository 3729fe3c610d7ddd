#pragma once

#include <string>
#include <string_view>

#include "app/train/run_config.h"

/// What makes two runs the same run. Resuming, the cells of a sweep and whoever else must tell runs
/// apart ask here.

namespace slalom::train {

/// Goes up whenever the same config and seed give other bits than before: with a change of the
/// simulator, of sampling, of an update, or of a golden hash in the tests. So it does with a change
/// of a default, as identities leave out keys at their defaults
/// (tests/app/train/deciding_defaults.txt lists them).
inline constexpr int kNumericsVersion = 3;

/// What the bits of a deterministic run depend on besides its config: float arithmetic differs
/// between kernels and instruction sets. A value.
struct Platform {
  int numerics = kNumericsVersion;
  std::string blas_kernel;  ///< `nn::BlasKernel`; "none" where the BLAS does not say.
  std::string processor;    ///< "x86-64-v2", "x86-64-v3", "x86-64-v4", or the architecture's name.

  friend bool operator==(const Platform&, const Platform&) = default;
};
Platform ThisPlatform();

/// "numerics 1, Haswell, x86-64-v3", for people.
std::string Describe(const Platform& platform);

/// Whether a key of `RunConfig` decides what a run of this config does up to any given step.
/// Limits, logging, evaluation and addresses do not, so a run may be resumed with others.
bool DecidesRun(const RunConfig& config, std::string_view key);

/// The digest of the keys that decide a run and are not at their defaults: 16 hexadecimal digits. A
/// new key changes no digest. A run can be resumed with a config if and only if the digests are
/// equal.
std::string RunDigest(const RunConfig& config);

/// The first key that decides a run and differs between two configs, for an error.
struct KeyDifference {
  std::string key;    ///< Empty: there is none, and the digests are equal.
  std::string first;  ///< The values, as TOML.
  std::string second;
};
KeyDifference FindDifference(const RunConfig& first, const RunConfig& second);

/// The digest of a text: 16 hexadecimal digits. Digests of several texts are not exchangeable.
std::string Digest(std::string_view text);

}  // namespace slalom::train
