#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/engines/jackal/world.h"

namespace slalom::engines {

/// The version of ODE that this was compiled with, "0.16.2".
std::string OdeVersion();

/// Makes worlds of the Open Dynamics Engine with the settings that Gazebo gave it in the original:
/// contacts of stiffness 1e7 N/m and damping 1 N s/m for each of the two surfaces, 50 iterations of
/// its quick solver, and friction bounded separately along two axes, the first of which is the x
/// axis of the wheel's own frame and so turns with the wheel.
std::vector<std::unique_ptr<World>> MakeOdeWorlds(const Jackal& jackal, double step, int count);

}  // namespace slalom::engines
