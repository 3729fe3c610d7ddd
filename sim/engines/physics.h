#pragma once

#include <string_view>
#include <vector>

#include "sim/robot_body.h"

namespace slalom::engines {

/// A physics that this project knows, whether this program was built with it or not.
struct PhysicsInfo {
  std::string_view name;
  std::string_view package;  ///< Debian package that it is built with. Empty for Slalom's own.
  bool is_built_in = true;
};

/// All of them, Slalom's own first.
const std::vector<PhysicsInfo>& KnownPhysics();

/// The physics of this name. Throws `base::Error` if there is none (the error lists them), or if
/// the program was built without it (the error says what to install, and that the program has to be
/// built again).
sim::Physics FindPhysics(std::string_view name);

/// The physics of a list such as "slalom,ode", or of "all". Slalom's own comes first if it is in
/// the list, as others are compared with it; apart from this they are in the order given. Throws
/// `base::Error` like `FindPhysics`, and if one is named twice.
std::vector<sim::Physics> FindPhysicsList(std::string_view list);

}  // namespace slalom::engines
