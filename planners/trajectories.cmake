# TEB and MPPI.
list(APPEND planner_headers clearance_map.h control_sequence.h local_path.h mppi.h mppi_config.h mppi_critics.h
  rollouts.h)
list(APPEND planner_sources clearance_map.cc control_sequence.cc local_path.cc mppi.cc mppi_critics.cc rollouts.cc)
# So that square roots and choices become vector instructions; neither option changes a result.
set_source_files_properties(clearance_map.cc control_sequence.cc mppi.cc mppi_critics.cc rollouts.cc PROPERTIES
  COMPILE_OPTIONS "-fno-math-errno;-fno-trapping-math")
