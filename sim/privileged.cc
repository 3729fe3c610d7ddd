#include "sim/privileged.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "base/geometry.h"
#include "env/action.h"
#include "env/observation.h"

namespace slalom::sim {
namespace {

constexpr float kPlaceScale = 5.0f;  // [m]

/// A moving obstacle in the robot's frame.
struct Told {
  float distance = 0.0f;       // To the circle round it, [m].
  float x = 0.0f, y = 0.0f;    // [m]
  float vx = 0.0f, vy = 0.0f;  // [m/s]
};

}  // namespace

void WritePrivileged(const EnvironmentConfig& config, const RobotBody& robot,
                     const MovingObstacles& moving, double motion_time, std::span<float> numbers) {
  SLALOM_CHECK_EQ(numbers.size(), static_cast<std::size_t>(env::kPrivilegedSize));
  const base::Pose2 X_WR = robot.pose();
  const auto [sine, cosine] = base::SinCos(X_WR.yaw);
  const auto s = static_cast<float>(sine), c = static_cast<float>(cosine);
  const BodyState& body = robot.body();

  std::array<Told, env::kToldObstacles> nearest;
  int num_told = 0;
  for (int i = 0; i < moving.size(); ++i) {
    const MovingShape shape = moving.At(i, motion_time);
    const float dx = shape.box.x - static_cast<float>(X_WR.p.x);
    const float dy = shape.box.y - static_cast<float>(X_WR.p.y);
    const Told told{.distance = std::hypot(dx, dy) - moving.circumradius(i),
                    .x = c * dx + s * dy,
                    .y = c * dy - s * dx,
                    .vx = c * shape.vx + s * shape.vy,
                    .vy = c * shape.vy - s * shape.vx};
    const auto end = nearest.begin() + num_told;
    const auto place =
        std::ranges::upper_bound(nearest.begin(), end, told.distance, {}, &Told::distance);
    if (place == nearest.end()) continue;
    if (num_told < env::kToldObstacles) ++num_told;
    std::shift_right(place, nearest.begin() + num_told, 1);
    *place = told;
  }

  auto out = numbers.begin();
  const env::Action speeds = config.action.Scale(cosine * body.vx + sine * body.vy, body.yaw_rate);
  *out++ = speeds.linear;
  *out++ = speeds.angular;
  for (const Told& told : nearest) {
    for (const float number : {told.x / kPlaceScale, told.y / kPlaceScale, told.vx, told.vy}) {
      *out++ = number;
    }
  }
  const RobotConfig& drive = config.robot;
  for (const double number :
       {10.0 * drive.command_delay, 10.0 * drive.command_jitter, 10.0 * (drive.speed_gain - 1.0),
        10.0 * (drive.yaw_gain - 1.0), drive.linear_acceleration / 20.0,
        drive.angular_acceleration / 25.0}) {
    *out++ = static_cast<float>(number);
  }
  SLALOM_CHECK(out == numbers.end());
}

}  // namespace slalom::sim
