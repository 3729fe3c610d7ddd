list(APPEND course_headers)
list(APPEND course_sources)
