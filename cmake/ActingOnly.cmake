# Only what drives by a policy (SLALOM_ACTING_ONLY): the folders that `slalom_policy_actor` stands on, without LibTorch. Of other
# libraries only headers are used, so that a program for another processor needs the cross compiler and no package for that
# processor, and a robot needs nothing but the program.
set(SLALOM_TORCH OFF)
find_package(Threads REQUIRED)

# slalom_add_header_only(TARGET HEADER [DEFINITIONS ...])
function(slalom_add_header_only TARGET HEADER)
  cmake_parse_arguments(ARG "" "" "DEFINITIONS" ${ARGN})
  find_path(header_${HEADER} ${HEADER} PATHS /usr/include REQUIRED NO_CACHE)
  add_library(${TARGET} INTERFACE IMPORTED GLOBAL)
  target_compile_definitions(${TARGET} INTERFACE ${ARG_DEFINITIONS})
endfunction()
slalom_add_header_only(fmt::fmt fmt/format.h DEFINITIONS FMT_HEADER_ONLY)
slalom_add_header_only(spdlog::spdlog spdlog/spdlog.h)
slalom_add_header_only(nlohmann_json::nlohmann_json nlohmann/json.hpp)
slalom_add_header_only(PkgConfig::XXHASH xxhash.h DEFINITIONS XXH_INLINE_ALL)

foreach(folder base env policy)
  add_subdirectory(${folder})
endforeach()

if(SLALOM_TESTS)
  enable_testing()
  include(GoogleTest)
  add_subdirectory(/usr/src/googletest googletest EXCLUDE_FROM_ALL)
  foreach(library gtest gtest_main gmock)
    if(NOT TARGET GTest::${library})
      add_library(GTest::${library} ALIAS ${library})
    endif()
  endforeach()
  add_subdirectory(tests)
endif()
