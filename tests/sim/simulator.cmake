slalom_add_test(motion_test SOURCES motion_test.cc DEPS slalom::sim)
slalom_add_test(moving_obstacles_test SOURCES moving_obstacles_test.cc DEPS slalom::sim)
slalom_add_test(lidar_test SOURCES lidar_test.cc DEPS slalom::sim)
slalom_add_test(collision_map_test SOURCES collision_map_test.cc DEPS slalom::sim)
slalom_add_test(robot_test SOURCES robot_test.cc DEPS slalom::sim)
slalom_add_test(skid_steering_test SOURCES skid_steering_test.cc DEPS slalom::sim)
slalom_add_test(environments_test SOURCES environments_test.cc environments_determinism_test.cc
    ${PROJECT_SOURCE_DIR}/tests/support/allocation_count.cc
  DEPS slalom::sim slalom::config)
slalom_add_test(contact_test SOURCES contact_test.cc DEPS slalom::sim)
slalom_add_test(localisation_test SOURCES localisation_test.cc DEPS slalom::sim slalom::config)
