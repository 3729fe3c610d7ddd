list(APPEND planner_headers costmap.h distance_grid.h dwa.h dwa_config.h elastic_band.h
  elastic_band_config.h elastic_band_planner.h footprint.h global_planner.h inflation.h
  navigation_config.h navigator.h obstacle_map.h planner_agent.h planner_registry.h rotate_recovery.h scan.h)
list(APPEND planner_sources costmap.cc distance_grid.cc dwa.cc elastic_band.cc
  elastic_band_planner.cc footprint.cc global_planner.cc inflation.cc navigator.cc
  obstacle_map.cc planner_agent.cc planner_registry.cc rotate_recovery.cc scan.cc)
