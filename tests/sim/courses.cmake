slalom_add_test(course_generator_test SOURCES course_generator_test.cc course_path_test.cc
    course_difficulty_test.cc barn_data.cc
  DEPS slalom::sim)
slalom_add_test(course_sets_test SOURCES course_sets_test.cc course_overlap_test.cc course_file_test.cc course_check_test.cc
    barn_data.cc
    ${PROJECT_SOURCE_DIR}/tests/support/fontconfig_leaks.cc
  DEPS slalom::sim)
slalom_add_test(barn_importer_test SOURCES barn_importer_test.cc barn_data_test.cc barn_data.cc DEPS slalom::sim)
slalom_add_test(course_render_test SOURCES course_render_test.cc episode_file_test.cc
    ${PROJECT_SOURCE_DIR}/tests/support/fontconfig_leaks.cc
  DEPS slalom::sim)
slalom_add_test(dynamic_courses_test SOURCES dynamic_generator_test.cc dynamic_importer_test.cc
    real_world_courses_test.cc
    barn_data.cc
  DEPS slalom::sim)
slalom_add_test(animation_test SOURCES animation_test.cc
    ${PROJECT_SOURCE_DIR}/tests/support/fontconfig_leaks.cc
  DEPS slalom::sim)
