#include "app/train/guarded.h"

#include <gmock/gmock.h>

#include "base/error.h"

namespace slalom::train {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(GuardedTest, KnowsTheRobotOfTheTask) {
  const planners::RobotModel usual;
  const planners::RobotModel jackal = GuardedRobotOf({}).model;
  EXPECT_DOUBLE_EQ(jackal.length, usual.length);
  EXPECT_DOUBLE_EQ(jackal.width, usual.width);
  EXPECT_DOUBLE_EQ(jackal.mass, usual.mass);
  EXPECT_DOUBLE_EQ(jackal.yaw_inertia, usual.yaw_inertia);
  EXPECT_DOUBLE_EQ(jackal.centre_x, usual.centre_x);
  EXPECT_DOUBLE_EQ(jackal.centre_y, usual.centre_y);
  EXPECT_DOUBLE_EQ(jackal.centre_z, usual.centre_z);

  sim::EnvironmentConfig task;
  task.robot.command_delay = 0.05;
  task.robot.command_jitter = 0.07;
  task.robot.wheel_friction = 0.3;
  task.robot.drive = sim::DriveKind::kIdeal;
  task.lidar.offset_x = -0.1;
  task.episode.step = 0.1;
  const planners::GuardedRobot robot = GuardedRobotOf(task);
  EXPECT_DOUBLE_EQ(robot.model.delay, 0.12) << "the longest";
  EXPECT_DOUBLE_EQ(robot.model.friction, 0.3);
  EXPECT_DOUBLE_EQ(robot.model.centre_x, 0.0);
  EXPECT_FALSE(robot.model.slips);
  EXPECT_DOUBLE_EQ(robot.scan.p_RS.x, -0.1);
  EXPECT_DOUBLE_EQ(robot.scan.clip, 5.0);
  EXPECT_DOUBLE_EQ(robot.step, 0.1);
}

TEST(GuardedTest, RefusesSettingsOfAGuardThatIsOff) {
  EXPECT_THAT([] { Guarded({}, {.margin = 0.1}); },
              ThrowsMessage<base::Error>(HasSubstr("guard.margin is 0.1, expected its default 0.05 "
                                                   "with guard.shield = false")));
  EXPECT_NO_THROW(Guarded({}, {}));
}

}  // namespace
}  // namespace slalom::train
