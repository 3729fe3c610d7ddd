# TEB and MPPI.
list(APPEND planner_headers band_optimizer.h banded_system.h clearance_map.h control_sequence.h homotopy.h
  local_path.h mppi.h mppi_config.h mppi_critics.h rollouts.h teb.h teb_config.h teb_edges.h timed_band.h)
list(APPEND planner_sources band_optimizer.cc banded_system.cc clearance_map.cc control_sequence.cc homotopy.cc
  local_path.cc mppi.cc mppi_critics.cc rollouts.cc teb.cc teb_edges.cc timed_band.cc)
