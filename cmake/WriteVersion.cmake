# Writes OUTPUT (a C++ source) with the commit of SOURCE_DIR, only where it changed. Run at every build.
# Where there is no repository (in an image's build) the environment's SLALOM_COMMIT says it.
execute_process(COMMAND git -C ${SOURCE_DIR} rev-parse --short=12 HEAD
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed AND NOT "$ENV{SLALOM_COMMIT}" STREQUAL "")
  set(commit $ENV{SLALOM_COMMIT})
elseif(failed)
  set(commit unknown)
else()
  execute_process(COMMAND git -C ${SOURCE_DIR} status --porcelain --untracked-files=no
    OUTPUT_VARIABLE changes ERROR_QUIET)
  if(changes)
    string(APPEND commit "+")
  endif()
endif()
set(content "#include \"base/version.h\"\n
namespace slalom::base {\n
std::string_view Version() { return \"${VERSION} (${commit}, ${BUILD_TYPE})\"; }\n
std::string_view Commit() { return \"${commit}\"; }\n
}  // namespace slalom::base\n")
set(old "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} old)
endif()
if(NOT content STREQUAL old)
  file(WRITE ${OUTPUT} "${content}")
endif()
