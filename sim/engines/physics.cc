#include "sim/engines/physics.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/split.h"
#include "sim/engines/jackal/engine_body.h"

#if SLALOM_HAS_ODE
#include "sim/engines/ode/ode_world.h"
#endif
#if SLALOM_HAS_MUJOCO
#include "sim/engines/mujoco/mujoco_world.h"
#endif

namespace slalom::engines {
namespace {

constexpr std::string_view kOwn = "slalom";
constexpr std::string_view kAll = "all";

}  // namespace

const std::vector<PhysicsInfo>& KnownPhysics() {
  static const std::vector<PhysicsInfo> known = {
      {kOwn, "", true},
      {"ode", "libode-dev", SLALOM_HAS_ODE == 1},
      {"mujoco", "libmujoco-dev", SLALOM_HAS_MUJOCO == 1},
  };
  return known;
}

sim::Physics FindPhysics(std::string_view name) {
  const auto& known = KnownPhysics();
  const auto info = std::ranges::find(known, name, &PhysicsInfo::name);
  if (info == known.end()) {
    std::string names;
    for (const PhysicsInfo& each : known) names += fmt::format("{}, ", each.name);
    throw base::Error("--physics '{}': expected {}several of them with commas, or {}", name, names,
                      kAll);
  }
  if (!info->is_built_in) {
    throw base::Error(
        "--physics {}: this program was built without it; install Debian 12's {} (apt-get install "
        "{}) and build the program again (./slalom build) without SLALOM_{}=OFF",
        name, info->package, info->package, name == "ode" ? "ODE" : "MUJOCO");
  }
#if SLALOM_HAS_ODE
  if (name == "ode") return {"ode", OdeVersion(), BodiesIn("ode", MakeOdeWorlds)};
#endif
#if SLALOM_HAS_MUJOCO
  if (name == "mujoco") return {"mujoco", MujocoVersion(), BodiesIn("mujoco", MakeMujocoWorlds)};
#endif
  return {};
}

std::vector<sim::Physics> FindPhysicsList(std::string_view list) {
  std::vector<sim::Physics> found;
  if (list == kAll) {
    for (const PhysicsInfo& info : KnownPhysics()) found.push_back(FindPhysics(info.name));
    return found;
  }
  for (const std::string_view name : base::Split(list, ',')) {
    base::ThrowIf(std::ranges::find(found, name, &sim::Physics::name) != found.end(),
                  "--physics {}: names {} twice", list, name);
    found.push_back(FindPhysics(name));
  }
  std::stable_partition(found.begin(), found.end(),
                        [](const sim::Physics& physics) { return physics.name == kOwn; });
  return found;
}

}  // namespace slalom::engines
