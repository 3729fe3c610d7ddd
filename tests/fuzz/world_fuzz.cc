// Gazebo worlds of the original data set.

#include <cmath>

#include "base/error.h"
#include "sim/courses/world_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const sim::World world = sim::ParseWorld(text, "input");
    for (const sim::Circle& circle : world.circles) {
      fuzz::Require(std::isfinite(circle.p_W.x) && std::isfinite(circle.p_W.y) &&
                    circle.radius > 0.0);
    }
    for (const sim::Box& box : world.boxes) {
      fuzz::Require(std::isfinite(box.X_WB.yaw) && box.half_size.x > 0.0 && box.half_size.y > 0.0);
    }
  } catch (const base::Error& error) {
    fuzz::Require(std::string_view(error.what()).starts_with("input"));
  }
  return 0;
}
