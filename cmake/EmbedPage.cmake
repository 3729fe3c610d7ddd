# Writes OUTPUT, a C++ source that defines NAMESPACE::CONSTANT: the skeleton SHARED/page.html with SHARED/page.css, TITLE, the
# directives SOURCES of its policy, what PAGE has (before <main>: for its bar) and SCRIPTS. Lists have "|" between their items.
# The delimiter of the raw string must not occur in the files; g++ takes strings of any length.
file(READ ${SHARED}/page.html text)
file(READ ${SHARED}/page.css STYLE)
file(READ ${PAGE} body)
string(FIND "${body}" "<main" begin)
string(SUBSTRING "${body}" 0 ${begin} BAR)
string(SUBSTRING "${body}" ${begin} -1 MAIN)
string(REPLACE "|" ";" scripts "${SCRIPTS}")
string(REPLACE "|" "; " SOURCES "${SOURCES}")
set(SCRIPT "")
foreach(path IN LISTS scripts)
  file(READ ${path} part)
  string(APPEND SCRIPT "${part}")
endforeach()
foreach(mark SOURCES TITLE STYLE BAR MAIN SCRIPT)
  string(STRIP "${${mark}}" content)
  string(REPLACE "@${mark}@" "${content}" text "${text}")
endforeach()
string(FIND "${text}" ")slalompage\"" found)
if(NOT found EQUAL -1)
  message(FATAL_ERROR "${PAGE}: holds the delimiter of a raw string")
endif()
file(WRITE ${OUTPUT} "#include <string_view>\n
namespace ${NAMESPACE} {\n
extern const std::string_view ${CONSTANT};
const std::string_view ${CONSTANT} = R\"slalompage(${text})slalompage\";\n
}  // namespace ${NAMESPACE}\n")
