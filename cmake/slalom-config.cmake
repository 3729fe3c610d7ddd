# find_package(slalom): slalom::sim, slalom::replay, slalom::policy_actor, slalom::planners and what they stand on (docs/robot.md, ARCHITECTURE.md).
include(CMakeFindDependencyMacro)
foreach(dependency Threads Eigen3 fmt spdlog nlohmann_json box2d tinyxml2 tomlplusplus PkgConfig)
  find_dependency(${dependency})
endforeach()
pkg_check_modules(XXHASH REQUIRED QUIET IMPORTED_TARGET libxxhash)
include(${CMAKE_CURRENT_LIST_DIR}/slalom-targets.cmake)
