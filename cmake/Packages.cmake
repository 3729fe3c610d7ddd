# What `cpack` makes of a build tree: a Debian package of the program and its presets or, in the tree of the preset python, packages of
# the Python package and of the C++ libraries. They need the libraries of the Debian that they were built on.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # An installation takes what is built, and builds no tests.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME slalom)
set(CPACK_PACKAGE_VENDOR "The Slalom authors")
set(CPACK_PACKAGE_CONTACT "The Slalom authors <slalom@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

# Slalom's licence, and the notices of the libraries of which code is compiled into it, as their Debian packages have them.
file(READ ${PROJECT_SOURCE_DIR}/LICENSE notices)
foreach(library libtorch-dev libbox2d-dev libeigen3-dev libcli11-dev libspdlog-dev libfmt-dev libtomlplusplus-dev nlohmann-json3-dev
    libprotobuf-dev prometheus-cpp-dev cppzmq-dev libxxhash-dev pybind11-dev)
  if(EXISTS /usr/share/doc/${library}/copyright)
    file(READ /usr/share/doc/${library}/copyright notice)
    string(APPEND notices "\n\n======== ${library} ========\n\n${notice}")
  endif()
endforeach()
file(WRITE ${CMAKE_BINARY_DIR}/copyright "${notices}")
function(slalom_install_notices DESTINATION COMPONENT)
  install(FILES ${CMAKE_BINARY_DIR}/copyright DESTINATION ${DESTINATION} COMPONENT ${COMPONENT})
endfunction()

if(SLALOM_PYTHON_PACKAGE)
  set(CPACK_COMPONENTS_ALL python development)
  slalom_install_notices(${SLALOM_PYTHON_DESTINATION}/slalom python)
  slalom_install_notices(share/doc/libslalom-dev development)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-slalom)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Robot navigation through obstacle courses, behind Gymnasium's interfaces")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS slalom)

  # find_package(slalom): the simulator, the replay buffer, policies that drive and their guard, for C++ programs and shared objects.
  set(libraries base config env courses sim planners replay nn_inference policy_file policy_actor)
  list(TRANSFORM libraries PREPEND slalom_ OUTPUT_VARIABLE targets)
  add_custom_target(slalom_libraries DEPENDS ${targets})
  install(TARGETS ${targets} EXPORT slalom ARCHIVE DESTINATION lib/slalom COMPONENT development
    FILE_SET HEADERS DESTINATION include/slalom COMPONENT development)
  install(EXPORT slalom NAMESPACE slalom:: FILE slalom-targets.cmake DESTINATION lib/cmake/slalom COMPONENT development)
  include(CMakePackageConfigHelpers)
  write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/slalom-config-version.cmake COMPATIBILITY SameMinorVersion)
  install(FILES cmake/slalom-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/slalom-config-version.cmake
    DESTINATION lib/cmake/slalom COMPONENT development)
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libslalom-dev)
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
  set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "C++ libraries of Slalom: simulator, replay buffer, planners, and policies that drive")
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libeigen3-dev, libfmt-dev, libspdlog-dev, nlohmann-json3-dev, libbox2d-dev, libtinyxml2-dev, libtomlplusplus-dev, libxxhash-dev, pkg-config")
else()
  set(CPACK_COMPONENTS_ALL program)
  slalom_install_notices(share/doc/slalom program)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME slalom)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
  set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "Training service for robot navigation by reinforcement learning")
  # LibTorch takes any BLAS; the reference one is 20 times slower.
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS libopenblas0-pthread)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "ffmpeg, fonts-dejavu-core")
endif()
include(CPack)
