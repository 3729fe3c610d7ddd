# Writes OUTPUT (a C++ source) with a page: HTML, the STYLE files and the SCRIPTS (each joined in order; "|" between them).
# HEADER declares what it defines in NAMESPACE: NAMEHtml, NAMEStyle and NAMEScript.
# The delimiter of the raw strings must not occur in the files; g++ takes strings of any length.
function(read_part variable)
  set(text "")
  foreach(path IN LISTS ARGN)
    file(READ ${path} part)
    string(APPEND text "${part}")
  endforeach()
  string(FIND "${text}" ")slalompage\"" found)
  if(NOT found EQUAL -1)
    message(FATAL_ERROR "${ARGN}: holds the delimiter of a raw string")
  endif()
  set(${variable} "R\"slalompage(${text})slalompage\"" PARENT_SCOPE)
endfunction()

string(REPLACE "|" ";" styles "${STYLE}")
string(REPLACE "|" ";" scripts "${SCRIPTS}")
read_part(html ${HTML})
read_part(style ${styles})
read_part(script ${scripts})
file(WRITE ${OUTPUT} "#include \"${HEADER}\"\n
namespace ${NAMESPACE} {\n
const std::string_view ${NAME}Html = ${html};\n
const std::string_view ${NAME}Style = ${style};\n
const std::string_view ${NAME}Script = ${script};\n
}  // namespace ${NAMESPACE}\n")
