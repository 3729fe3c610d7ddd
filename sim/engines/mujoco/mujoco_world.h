#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/engines/jackal/world.h"

namespace slalom::engines {

/// The version of MuJoCo that is loaded, "2.2.2".
std::string MujocoVersion();

/// Makes worlds of MuJoCo with an elliptic friction cone and wheels that turn exactly as asked.
std::vector<std::unique_ptr<World>> MakeMujocoWorlds(const Jackal& jackal, double step, int count);

}  // namespace slalom::engines
