#pragma once

#include <string>
#include <string_view>

#include "app/train/run_config.h"

namespace slalom::train {

/// The config that a policy, a checkpoint or a run directory holds. It has every key that existed
/// when it was written.
struct RecordedConfig {
  RunConfig config;
  /// It is from before `environment.robot.friction`. Every robot then had Coulomb's cone, its
  /// masses midway between the wheels and wheels that touch the ground at one point, so `config`
  /// says so, whatever the defaults are now.
  bool before_friction_laws = false;
};

/// Reads such a config. Throws `base::Error` that names `source` if it is damaged or has keys that
/// this program does not know.
RecordedConfig ReadRecordedConfig(std::string_view text, std::string_view source);

/// One line about such a config, to be put after its source: what the old drive is, and how to have
/// the present one.
std::string DescribeDriveBeforeFrictionLaws();

}  // namespace slalom::train
