# TEB and MPPI.
list(APPEND planner_headers band_optimizer.h banded_system.h clearance_map.h control_sequence.h homotopy.h
  local_path.h mppi.h mppi_config.h mppi_critics.h rollouts.h teb.h teb_config.h teb_edges.h timed_band.h)
list(APPEND planner_sources band_optimizer.cc banded_system.cc clearance_map.cc control_sequence.cc homotopy.cc
  local_path.cc mppi.cc mppi_critics.cc rollouts.cc teb.cc teb_edges.cc timed_band.cc)
# So that square roots and choices become vector instructions; neither option changes a result.
set_source_files_properties(clearance_map.cc control_sequence.cc mppi.cc mppi_critics.cc rollouts.cc PROPERTIES
  COMPILE_OPTIONS "-fno-math-errno;-fno-trapping-math")
