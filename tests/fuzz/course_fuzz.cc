// Course files.

#include "base/error.h"
#include "sim/courses/course_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string text(reinterpret_cast<const char*>(data), size);
  // Edited by hand no checksum is needed.
  for (const std::string& whole : {text, text + "checksum none\n"}) {
    try {
      const sim::CourseSet set = sim::ParseCourseSet(whole, "input", "/nowhere");
      const std::string printed = sim::PrintCourseSet(set);
      fuzz::Require(sim::PrintCourseSet(sim::ParseCourseSet(printed, "printed", "")) == printed);
    } catch (const base::Error& error) {
      const std::string_view what = error.what();
      fuzz::Require(what.starts_with("input:") || what.starts_with("/nowhere/"));
    }
  }
  return 0;
}
