list(APPEND planner_headers costmap.h)
list(APPEND planner_sources costmap.cc)
