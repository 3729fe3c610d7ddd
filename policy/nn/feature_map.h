#pragma once

#include <cstdint>
#include <vector>

#include "env/observation.h"
#include "policy/nn/network_config.h"

/// Shapes: `N` beams, `R` ranges seen (sectors, or N), `S` numbers of a state, `F` = R + S numbers
/// of a frame.

namespace slalom::nn {

/// Maps a frame to the numbers that a network sees: pools sectors by their minimum, and scales
/// ranges and goal. What follows the goal is seen as it is. Without beams the state is no course's,
/// and is seen as it is.
///
/// By default that is the observation of the paper (docs/original-system.md, section 1.3). Ranges
/// are pooled as the sensor's integers and mapped by table, so every machine computes the same
/// numbers. Immutable after construction, so one instance may serve many threads.
class FeatureMap {
 public:
  /// Throws `base::Error` if the sectors do not divide the beams, if there are beams beside a state
  /// that is no course's, or if the encoder needs beams and there are none, or takes no state of
  /// more than `env::kStateSize` numbers.
  FeatureMap(const env::ObservationSpec& spec, const NetworkConfig& config);

  /// Writes one frame's features. If `mirrored`, writes the features of the scene with left and
  /// right exchanged: beams reversed, goal y and turns negated. `ranges_cm`: [N]; `state`: [S];
  /// `features`: [F].
  void Write(const std::uint16_t* ranges_cm, const float* state, bool mirrored,
             float* features) const;

  /// Appends the newest frame of each environment to its stack: the stack moves up by one, or, at
  /// the beginning of an episode, becomes copies of the first frame. `stacks`: [B, H * F], oldest
  /// first.
  void PushFrames(const env::ObservationBatch& observations, int history, float* stacks) const;

  /// Asks the processor to fetch a scan that `Write` will read soon.
  void Prefetch(const std::uint16_t* ranges_cm) const;

  int frame_size() const { return num_ranges_ + state_size_; }  ///< F
  int num_beams() const { return num_beams_; }

 private:
  void WriteGoal(const float* goal, float side, float* features) const;
  void PoolSectors(const std::uint16_t* ranges_cm, bool mirrored, float* features) const;

  int num_beams_;
  int state_size_;
  int num_ranges_;
  int beams_per_range_;
  GoalTransform goal_transform_;
  float goal_scale_;
  std::vector<float> mirror_;  ///< [S], -1 for a number whose sign a mirror changes, else 1.
  std::vector<float> table_;   ///< [clip in cm + 1], the feature of each range in cm.
};

}  // namespace slalom::nn
