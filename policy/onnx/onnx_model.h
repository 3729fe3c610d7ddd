#pragma once

#include <string>

#include "policy/policy.h"

/// Policies for programs that read ONNX (https://onnx.ai), such as ONNX Runtime.

namespace slalom::policy {

/// A policy as the bytes of an ONNX model (operator set 17), which computes the same as
/// `NetworkAgent`, from the robot's scan to its command. For a batch of B, N beams, F = ranges +
/// S features and H frames of history:
///
/// in   `ranges` [B, N] uint16, [cm], counter-clockwise; `state` [B, S] float, see
///      `env::kStateFields`; if H > 1 also `frames` [B, H, F] float and `first` [B] bool
/// out  `command` [B, 2] float, [m/s] and [rad/s]; `action` [B, 2] float, in [-1, 1]; if H > 1 also
///      `frames_after` [B, H, F] float, the `frames` of the next step
///
/// If `first` is true, an episode begins, and `frames` are not read. The model has `metadata` and
/// the policy's spec beside its graph, and as `standstill` the last action of a first frame.
///
/// Throws `base::Error` if the policy drops units when it acts, which no model reproduces.
/// Thread-safe.
std::string PrintOnnx(const PolicySnapshot& snapshot, const nn::Metadata& metadata);

}  // namespace slalom::policy
