list(APPEND course_headers
  barn_field.h course_check.h course_difficulty.h course_file.h course_generator.h course_path.h
  course_sets.h course_splits.h)
list(APPEND course_sources
  barn_field.cc course_check.cc course_difficulty.cc course_file.cc course_generator.cc course_path.cc
  course_sets.cc course_splits.cc)
