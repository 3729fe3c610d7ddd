# TEB and MPPI.
slalom_add_test(mppi_parts_test SOURCES clearance_map_test.cc control_sequence_test.cc local_path_test.cc
  mppi_critics_test.cc rollouts_test.cc DEPS slalom::planners)
slalom_add_test(mppi_test SOURCES mppi_test.cc DEPS slalom::planners)
slalom_add_test(teb_parts_test SOURCES band_optimizer_test.cc banded_system_test.cc homotopy_test.cc teb_edges_test.cc
  timed_band_test.cc DEPS slalom::planners)
slalom_add_test(teb_test SOURCES teb_test.cc DEPS slalom::planners)
