# Writes OUTPUT (a C++ source) with the page of a report: HTML, STYLE and the SCRIPTS (joined in order; "|" between them).
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

string(REPLACE "|" ";" scripts "${SCRIPTS}")
read_part(html ${HTML})
read_part(style ${STYLE})
read_part(script ${scripts})
file(WRITE ${OUTPUT} "#include \"eval/report_page_parts.h\"\n
namespace slalom::eval {\n
const std::string_view kReportPageHtml = ${html};\n
const std::string_view kReportPageStyle = ${style};\n
const std::string_view kReportPageScript = ${script};\n
}  // namespace slalom::eval\n")
