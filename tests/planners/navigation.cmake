# Costmaps, navigation, DWA, E-band.
slalom_add_test(footprint_test SOURCES footprint_test.cc DEPS slalom::planners)
slalom_add_test(obstacle_map_test SOURCES obstacle_map_test.cc DEPS slalom::planners)
slalom_add_test(global_planner_test SOURCES global_planner_test.cc DEPS slalom::planners)
slalom_add_test(distance_grid_test SOURCES distance_grid_test.cc DEPS slalom::planners)
slalom_add_test(dwa_test SOURCES dwa_test.cc DEPS slalom::planners)
slalom_add_test(elastic_band_test SOURCES elastic_band_test.cc DEPS slalom::planners)
slalom_add_test(navigator_test SOURCES navigator_test.cc DEPS slalom::planners)
slalom_add_test(planner_agent_test SOURCES planner_agent_test.cc DEPS slalom::planners slalom::sim slalom::config)
