# What `cpack` makes of a build tree: a Debian package of the program and its presets or, in the tree of the preset python, of the
# Python package. They need the libraries of the Debian that they were built on.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # An installation takes what is built, and builds no tests.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "The Slalom authors")
set(CPACK_PACKAGE_CONTACT "The Slalom authors <slalom@localhost>")
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
if(SLALOM_PYTHON_PACKAGE)
  set(CPACK_PACKAGE_NAME python3-slalom)
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Robot navigation through obstacle courses, behind Gymnasium's interfaces")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr/lib/python3/dist-packages)
  set(CPACK_DEBIAN_PACKAGE_DEPENDS "python3 (>= 3.11), python3-numpy")
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS slalom)
else()
  set(CPACK_PACKAGE_NAME slalom)
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Training service for robot navigation by reinforcement learning")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_DEBIAN_PACKAGE_DEPENDS libopenblas0-pthread)  # LibTorch takes any BLAS; the reference one is 20 times slower.
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "ffmpeg, fonts-dejavu-core")
endif()
include(CPack)
