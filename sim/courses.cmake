list(APPEND course_headers
  animation.h animation_frames.h animation_svg.h
  barn_field.h barn_importer.h course_check.h course_difficulty.h course_file.h course_generator.h course_overlap.h
  course_painter.h course_path.h course_render.h course_sets.h course_splits.h course_text.h dynamic_generator.h
  dynamic_importer.h episode_file.h npy_file.h real_world_courses.h world_file.h)
list(APPEND course_sources
  animation.cc animation_frames.cc animation_svg.cc
  barn_field.cc barn_importer.cc course_check.cc course_difficulty.cc course_file.cc course_generator.cc course_overlap.cc
  course_painter.cc course_path.cc course_render.cc course_sets.cc course_splits.cc course_text.cc
  dynamic_generator.cc dynamic_importer.cc episode_file.cc npy_file.cc real_world_courses.cc
  world_file.cc)
