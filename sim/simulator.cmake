list(APPEND simulator_headers collision_map.h contact_world.h environment_config.h environments.h lidar.h localisation.h
  motion.h moving_obstacles.h robot.h scene.h skid_steering.h vector_lanes.h)
list(APPEND simulator_sources collision_map.cc contact_world.cc environment_config.cc environments.cc lidar.cc localisation.cc
  motion.cc moving_obstacles.cc robot.cc scene.cc skid_steering.cc)
