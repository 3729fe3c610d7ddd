list(APPEND simulator_headers)
list(APPEND simulator_sources)
