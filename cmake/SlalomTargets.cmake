# The ways to declare a target in this project: slalom_add_library, slalom_add_test, slalom_add_benchmark.

add_library(slalom_build_flags INTERFACE)
# -ffp-contract=off: the same arithmetic in debug and release, so that an episode is a value of (course, seed, actions).
# -fno-math-errno, -fno-trapping-math: nothing reads errno or floating-point exceptions, and without them square roots and
# selections become vector instructions. Results stay the same. They hold for all targets because a precompiled header serves
# only sources that are compiled with the same options.
target_compile_options(slalom_build_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wundef -Werror=return-type
  -ffp-contract=off -fno-math-errno -fno-trapping-math)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(slalom_build_flags INTERFACE -fpch-preprocess)  # lets ccache see through precompiled headers
  # The compiler looks for memory to free from 400 MB on: a tenth less time for a tenth more memory.
  target_compile_options(slalom_build_flags INTERFACE --param=ggc-min-heapsize=400000)
  if(CMAKE_UNITY_BUILD)
    target_compile_options(slalom_build_flags INTERFACE -Wno-subobject-linkage)  # takes sources that are joined for headers
  endif()
endif()
if(SLALOM_NATIVE)
  target_compile_options(slalom_build_flags INTERFACE -march=native)
endif()
if(SLALOM_SANITIZE)
  target_compile_options(slalom_build_flags INTERFACE -fsanitize=${SLALOM_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(slalom_build_flags INTERFACE -fsanitize=${SLALOM_SANITIZE})
endif()
target_include_directories(slalom_build_flags INTERFACE ${PROJECT_SOURCE_DIR})
# The default of libstdc++, which LibTorch's targets name: a precompiled header serves only sources that name it as well.
target_compile_definitions(slalom_build_flags INTERFACE _GLIBCXX_USE_CXX11_ABI=1)

# For what takes longer to compile than to run: tests (what they test is optimised as the build type says), the command line, and
# the parts of a run that only pass on what others compute.
set(SLALOM_QUICKLY_COMPILED $<$<NOT:$<CONFIG:Debug>>:-O1>)

# slalom_add_precompiled_headers(NAME HEADERS ... [DEPS ...] [OPTIONS ...])
# Headers that many files share, parsed once for all targets that name NAME as PRECOMPILED: ATen alone takes ten seconds. Files
# include what they use all the same: the presets dev and tidy have CMAKE_DISABLE_PRECOMPILE_HEADERS.
function(slalom_add_precompiled_headers NAME)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEPS;OPTIONS" ${ARGN})
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${NAME}.cc CONTENT "")
  add_library(${NAME} OBJECT ${CMAKE_CURRENT_BINARY_DIR}/${NAME}.cc)
  target_link_libraries(${NAME} PRIVATE ${ARG_DEPS} slalom_build_flags)
  # The same bytes each time, for ccache.
  target_compile_options(${NAME} PRIVATE ${ARG_OPTIONS} $<$<CXX_COMPILER_ID:Clang>:SHELL:-Xclang -fno-pch-timestamp>)
  target_precompile_headers(${NAME} PRIVATE ${ARG_HEADERS})
endfunction()

# slalom_add_library(NAME HEADERS ... SOURCES ... DEPS ... [PRECOMPILED ...] [QUICKLY_COMPILED])
# A library is a folder or several: target slalom_NAME, alias slalom::NAME. In preset dev the target all_verify_interface_header_sets
# compiles every header on its own, which proves that it is self-contained.
function(slalom_add_library NAME)
  cmake_parse_arguments(ARG "QUICKLY_COMPILED" "PRECOMPILED" "HEADERS;SOURCES;DEPS" ${ARGN})
  if(ARG_SOURCES)
    add_library(slalom_${NAME} STATIC ${ARG_SOURCES})
    set(scope PUBLIC)
  else()
    add_library(slalom_${NAME} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(slalom::${NAME} ALIAS slalom_${NAME})
  if(CMAKE_VERSION VERSION_LESS 3.23)  # It knows no sets of headers: cmake/Packages.cmake installs them by folder.
    target_include_directories(slalom_${NAME} ${scope} $<INSTALL_INTERFACE:include/slalom>)
  else()
    target_sources(slalom_${NAME} ${scope} FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ARG_HEADERS})
  endif()
  target_link_libraries(slalom_${NAME} ${scope} $<BUILD_INTERFACE:slalom_build_flags> ${ARG_DEPS})
  target_compile_features(slalom_${NAME} ${scope} cxx_std_20)
  set_target_properties(slalom_${NAME} PROPERTIES EXPORT_NAME ${NAME})
  if(ARG_SOURCES AND ARG_PRECOMPILED)
    target_precompile_headers(slalom_${NAME} REUSE_FROM ${ARG_PRECOMPILED})
  elseif(ARG_SOURCES AND TARGET slalom_headers)
    target_precompile_headers(slalom_${NAME} REUSE_FROM slalom_headers)
  endif()
  if(ARG_QUICKLY_COMPILED)
    target_compile_options(slalom_${NAME} PRIVATE ${SLALOM_QUICKLY_COMPILED})
  endif()
endfunction()

# slalom_add_messages(NAME FILE): target NAME with what protoc makes of FILE, which is compiled without our warnings and seen only by
# the library that links NAME privately. Its header is included as FOLDER/FILE.pb.h.
function(slalom_add_messages NAME FILE)
  cmake_path(GET FILE STEM stem)
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE folder)
  set(generated ${CMAKE_BINARY_DIR}/generated/${folder})
  file(MAKE_DIRECTORY ${generated})
  add_custom_command(
    OUTPUT ${generated}/${stem}.pb.cc ${generated}/${stem}.pb.h
    COMMAND protobuf::protoc --cpp_out=${CMAKE_BINARY_DIR}/generated -I ${PROJECT_SOURCE_DIR} ${folder}/${FILE}
    DEPENDS ${FILE}
    VERBATIM)
  add_library(${NAME} STATIC ${generated}/${stem}.pb.cc ${generated}/${stem}.pb.h)
  set_target_properties(${NAME} PROPERTIES UNITY_BUILD OFF)
  target_include_directories(${NAME} SYSTEM PUBLIC ${CMAKE_BINARY_DIR}/generated)
  target_link_libraries(${NAME} PUBLIC protobuf::libprotobuf)
endfunction()

# slalom_embed_page(NAME CONSTANT NAMESPACE TITLE PAGE SCRIPTS ... [SOURCES ...])
# Puts an HTML page into the library slalom_NAME: `extern const std::string_view NAMESPACE::CONSTANT`, which has everything in it
# but its data (eval/report/embedded_page.h). PAGE holds its bar and its <main>; the skeleton, the style and the scripts that all
# pages share are in eval/report/pages/. SOURCES: directives of its policy that let it load something.
function(slalom_embed_page NAME CONSTANT NAMESPACE TITLE PAGE)
  cmake_parse_arguments(ARG "" "" "SCRIPTS;SOURCES" ${ARGN})
  if(NOT ARG_SOURCES)
    set(ARG_SOURCES "img-src data:")
  endif()
  set(shared ${PROJECT_SOURCE_DIR}/eval/report/pages)
  set(rule ${PROJECT_SOURCE_DIR}/cmake/EmbedPage.cmake)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/generated/${CONSTANT}.cc)
  list(TRANSFORM ARG_SCRIPTS PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set(scripts ${shared}/page.js ${shared}/chart.js ${shared}/comparison.js ${ARG_SCRIPTS})
  set(page ${CMAKE_CURRENT_SOURCE_DIR}/${PAGE})
  list(JOIN scripts "|" joined)
  list(JOIN ARG_SOURCES "|" sources)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DSHARED=${shared} -DPAGE=${page} -DTITLE=${TITLE} "-DSOURCES=${sources}" "-DSCRIPTS=${joined}"
      -DNAMESPACE=${NAMESPACE} -DCONSTANT=${CONSTANT} -DOUTPUT=${output} -P ${rule}
    DEPENDS ${shared}/page.html ${shared}/page.css ${page} ${scripts} ${rule}
    VERBATIM)
  target_sources(slalom_${NAME} PRIVATE ${output})
  set_source_files_properties(${output} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# slalom_add_test(NAME SOURCES ... DEPS ... [LABELS ...] [PRECOMPILED ...] [TIMEOUT seconds] [PROCESSES number])
# One GoogleTest program, one ctest entry per test case, or PROCESSES entries that share the cases: LibTorch alone takes a second to
# load. ctest does not see a case that is skipped among others. PRECOMPILED is for sources most of which include LibTorch: each
# source pays for it, <torch/torch.h> with ten seconds.
# Labels: each folder from tests/ to the test's, and those given.
function(slalom_add_test NAME)
  cmake_parse_arguments(ARG "" "PRECOMPILED;TIMEOUT;PROCESSES" "SOURCES;DEPS;LABELS" ${ARGN})
  if(SLALOM_SANITIZE)
    set(ARG_TIMEOUT 600)
  elseif(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR}/tests OUTPUT_VARIABLE folder)
  string(REPLACE "/" ";" folders ${folder})
  set_property(DIRECTORY PROPERTY LABELS ${folders})
  add_executable(${NAME} ${ARG_SOURCES})
  set_target_properties(${NAME} PROPERTIES UNITY_BUILD OFF)  # Tests name their fixtures alike.
  target_link_libraries(${NAME} PRIVATE ${ARG_DEPS} slalom_build_flags GTest::gmock GTest::gtest_main)
  target_compile_definitions(${NAME} PRIVATE SLALOM_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(${NAME} PRIVATE ${SLALOM_QUICKLY_COMPILED})
  if(NOT ARG_PRECOMPILED)
    set(ARG_PRECOMPILED slalom_test_headers)
  endif()
  target_precompile_headers(${NAME} REUSE_FROM ${ARG_PRECOMPILED})
  if(ARG_PROCESSES)
    foreach(number RANGE 1 ${ARG_PROCESSES})
      set(entry ${NAME})
      if(ARG_PROCESSES GREATER 1)
        string(APPEND entry _${number})
      endif()
      math(EXPR index "${number} - 1")
      add_test(NAME ${entry} COMMAND ${NAME} --gtest_brief=1)
      set_tests_properties(${entry} PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}"
        ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_PROCESSES};GTEST_SHARD_INDEX=${index}")
    endforeach()
  else()
    gtest_discover_tests(${NAME} DISCOVERY_TIMEOUT 60
      PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
  endif()
endfunction()

# slalom_add_benchmark(NAME SOURCES ... DEPS ...): target slalom_benchmarks builds all of them.
function(slalom_add_benchmark NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${NAME} ${ARG_SOURCES})
  target_link_libraries(${NAME} PRIVATE ${ARG_DEPS} slalom_build_flags benchmark::benchmark benchmark::benchmark_main)
  if(NOT TARGET slalom_benchmarks)
    add_custom_target(slalom_benchmarks)
  endif()
  add_dependencies(slalom_benchmarks ${NAME})
  set_target_properties(${NAME} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/benchmarks)
endfunction()
