// Maps of ROS: a description, a zero byte, an image.

#include <cmath>

#include "base/error.h"
#include "sim/courses/map_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const std::size_t end = bytes.find('\0');
  const std::string_view image = end < bytes.size() ? bytes.substr(end + 1) : "";
  try {
    const sim::MapDescription description = sim::ParseMapDescription(bytes.substr(0, end), "input");
    fuzz::Require(description.resolution > 0.0 && std::isfinite(description.X_WM.yaw));
    const sim::OccupancyMap map = sim::ParseMapImage(description, image, "input");
    fuzz::Require(map.cells.size() ==
                  static_cast<std::size_t>(map.num_x) * static_cast<std::size_t>(map.num_y));
    fuzz::Require(map.cells.size() <= image.size());
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input"));
  }
  return 0;
}
