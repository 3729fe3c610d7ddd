#pragma once

#include <string>
#include <string_view>

#include "app/train/run_config.h"
#include "proto/run_identity.h"

/// Identity of a run: used by --resume and by sweeps.

namespace slalom::train {

/// Rises whenever the same config and seed give other bits than before: with a change of the
/// simulator, of sampling, of an update, or of a golden hash in the tests. It also rises with a
/// change of a default, because identities leave out keys at their defaults
/// (tests/app/train/deciding_defaults.txt lists them).
inline constexpr int kNumericsVersion = 3;

/// The platform of a deterministic run, on which its bits depend besides its config, because float
/// arithmetic differs between kernels and instruction sets. A value.
struct Platform {
  int numerics = kNumericsVersion;
  std::string blas_kernel;  ///< `nn::BlasKernel`; "none" if the BLAS does not say.
  std::string processor;    ///< "x86-64-v2", "x86-64-v3", "x86-64-v4", or the architecture's name.

  friend bool operator==(const Platform&, const Platform&) = default;
};
Platform ThisPlatform();

/// "numerics 1, Haswell, x86-64-v3", for people.
std::string Describe(const Platform& platform);

/// Whether a key of `RunConfig` affects a run of this config up to any given step. Limits, logging,
/// evaluation and addresses do not, so a run may be resumed with others.
bool DecidesRun(const RunConfig& config, std::string_view key);

/// The digest of the keys that decide a run and are not at their defaults: 16 hexadecimal digits. A
/// new key changes no digest. A run can be resumed with a config if and only if the digests are
/// equal.
std::string RunDigest(const RunConfig& config);

/// The first key that decides a run and differs between two configs, for an error.
struct KeyDifference {
  std::string key;    ///< Empty if there is none; the digests are then equal.
  std::string first;  ///< The values, as TOML.
  std::string second;
};
KeyDifference FindDifference(const RunConfig& first, const RunConfig& second);

/// The identity of a run for the processes of a service: the keys that say what is driven, observed
/// and rewarded. Each process may have its own of the others, for example exploration and paths.
proto::RunIdentity ServiceIdentity(const RunConfig& config);

/// The digest of a text: 16 hexadecimal digits. Digests of several texts are not exchangeable.
std::string Digest(std::string_view text);

}  // namespace slalom::train
