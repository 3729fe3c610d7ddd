#include "sim/pictures/animation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tinyxml2.h>

#include <cmath>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "sim/courses/barn_field.h"
#include "sim/pictures/animation_frames.h"
#include "sim/pictures/animation_svg.h"
#include "sim/pictures/course_painter.h"
#include "tests/support/moving_courses.h"

namespace slalom::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kStep = 0.1;

/// A drive that winds about and turns through pi more than once.
EpisodeTrack Wind(const std::string& course, std::uint64_t seed, int num_poses,
                  env::Outcome outcome = env::Outcome::kSuccess) {
  base::Random random(seed);
  EpisodeTrack track{course, outcome, {}};
  track.step = kStep;
  base::Pose2 pose{{-2.0, 3.0}, 1.5};
  double turn = 0.0;
  for (int i = 0; i < num_poses; ++i) {
    track.poses.push_back({pose.p, base::WrapAngle(pose.yaw)});
    turn = 0.9 * turn + random.Uniform(-0.15, 0.2);
    pose = {base::Transform(pose, {0.12, 0.0}), pose.yaw + turn};
  }
  return track;
}

std::shared_ptr<const Course> OpenCourse(const std::string& name) {
  return std::make_shared<const Course>(MakeBarnCourse(name, FieldGrid(), {}));
}

CourseSet OpenSet() { return {"open-set", {OpenCourse("a"), OpenCourse("b"), OpenCourse("c")}}; }

base::Pose2 Interpolated(const std::vector<PoseKey>& keys, double time) {
  std::size_t i = 1;
  while (i + 1 < keys.size() && keys[i].time < time) ++i;
  const PoseKey& a = keys[i - 1];
  const PoseKey& b = keys[i];
  const double fraction = b.time > a.time ? (time - a.time) / (b.time - a.time) : 1.0;
  return {a.pose.p + fraction * (b.pose.p - a.pose.p),
          a.pose.yaw + fraction * (b.pose.yaw - a.pose.yaw)};
}

TEST(Animation, PoseGoesEvenlyTheShorterWayAndStaysAtTheEnd) {
  EpisodeTrack track{"a", env::Outcome::kSuccess, {{{0.0, 0.0}, 3.0}, {{1.0, 2.0}, -3.0}}};
  track.step = 0.5;
  EXPECT_DOUBLE_EQ(DurationOf(track), 0.5);
  const base::Pose2 half = PoseAt(track, 0.25);
  EXPECT_DOUBLE_EQ(half.p.x, 0.5);
  EXPECT_DOUBLE_EQ(half.p.y, 1.0);
  EXPECT_NEAR(base::WrapAngle(half.yaw - base::kPi), 0.0, 1e-9);
  EXPECT_EQ(PoseAt(track, 0.5), track.poses.back());
  EXPECT_EQ(PoseAt(track, 100.0), track.poses.back());
}

TEST(Animation, KeysOfADriveAreFewAndNowhereFurtherThanTheTolerance) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const EpisodeTrack track = Wind("a", seed, 120);
    const auto keys = KeysOf(track, 0.02);
    EXPECT_LT(keys.size(), 100u);
    ASSERT_EQ(keys.front().time, 0.0);
    ASSERT_DOUBLE_EQ(keys.back().time, DurationOf(track));
    for (double time = 0.0; time < DurationOf(track); time += 0.5 * kStep) {
      const base::Pose2 kept = Interpolated(keys, time);
      const base::Pose2 driven = PoseAt(track, time);
      EXPECT_LT(base::Norm(kept.p - driven.p), 0.021) << "seed " << seed << " time " << time;
      EXPECT_LT(std::abs(base::WrapAngle(kept.yaw - driven.yaw)), 0.21);
    }
  }
}

TEST(Animation, KeysOfAMovingObstacleFollowItsMotionAndJumpWithIt) {
  base::Random random(7);
  const Course base_course = MakeBarnCourse("a", FieldGrid(), {});
  int num_jumps = 0;
  for (int i = 0; i < 20; ++i) {
    const auto course = test::WithMoving(base_course, 1, random);
    const Motion motion(course->moving[0]);
    const double begin = random.Uniform(0.0, 30.0);
    const double duration = random.Uniform(1.0, 20.0);
    const auto keys = KeysOf(course->moving[0], begin, duration, 0.01);
    ASSERT_EQ(keys.front().time, 0.0);
    ASSERT_DOUBLE_EQ(keys.back().time, duration);
    for (std::size_t k = 1; k < keys.size(); ++k) {
      ASSERT_GE(keys[k].time, keys[k - 1].time);
      num_jumps += keys[k].time == keys[k - 1].time;
    }
    for (double time = 0.013; time < duration; time += 0.037) {
      if (motion.BeginsRound(begin + time - 0.01, 0.02)) continue;
      const base::Vec2 kept = Interpolated(keys, time).p;
      EXPECT_LT(base::Norm(kept - motion.At(begin + time).X_WB.p), 0.02)
          << "obstacle " << i << " time " << time;
    }
  }
  EXPECT_GT(num_jumps, 5);
}

TEST(Animation, PanelsFollowTheSetAndDrivesAmongMovingObstaclesKeepTheirTime) {
  std::vector<EpisodeTrack> tracks = {Wind("c", 1, 30), Wind("a", 2, 20), Wind("c", 3, 40),
                                      Wind("elsewhere", 4, 20)};
  const auto panels = MakePanels(OpenSet(), tracks, "x");
  ASSERT_EQ(panels.size(), 2u);
  EXPECT_EQ(panels[0].title, "a");
  EXPECT_EQ(panels[1].title, "c");
  EXPECT_EQ(panels[1].tracks.size(), 2u);
  EXPECT_DOUBLE_EQ(DurationOf(panels[1]), 39 * kStep);
  EXPECT_EQ(CaptionOf(panels[0]), "success 1.9 s");
  EXPECT_EQ(CaptionOf(panels[1]), "2 success");

  base::Random random(1);
  const CourseSet moving{"m", {test::WithMoving(*OpenCourse("c"), 2, random)}};
  tracks[0].motion_start = 5.0;
  tracks[0].episode = 3;
  const auto apart = MakePanels(moving, tracks, "x");
  ASSERT_EQ(apart.size(), 2u);
  EXPECT_EQ(apart[0].title, "c, episode 3");
  EXPECT_EQ(apart[1].title, "c, episode 0");
}

TEST(Animation, WhatCannotBePlayedIsRefusedByName) {
  const auto error_of = [](std::vector<EpisodeTrack> tracks) -> std::string {
    try {
      MakePanels(OpenSet(), std::move(tracks), "tracks.jsonl");
      return "";
    } catch (const base::Error& error) {
      return error.what();
    }
  };
  EXPECT_EQ(error_of({Wind("d", 1, 5)}), "tracks.jsonl: holds no episode on a course of open-set");
  EpisodeTrack without_step = Wind("a", 1, 5);
  without_step.step = 0.0;
  EXPECT_THAT(error_of({without_step}),
              HasSubstr("tracks.jsonl: the episode 0 on course a has no step_s"));
  EXPECT_THAT(error_of({Wind("a", 1, 0)}), HasSubstr("has no poses"));
}

TEST(Animation, PanelsLieOnThePageAndNotOnEachOther) {
  for (const double around : {0.0, 1.5}) {
    for (const int columns : {1, 2, 3, 7}) {
      const auto animation = PlaceAnimation(
          MakePanels(OpenSet(), {Wind("a", 1, 50), Wind("b", 2, 90), Wind("c", 3, 9)}, "x"),
          {.num_columns = columns, .around = around});
      EXPECT_EQ(std::fmod(animation.width, 2.0), 0.0);
      EXPECT_EQ(std::fmod(animation.height, 2.0), 0.0);
      EXPECT_DOUBLE_EQ(animation.drive_time, 89 * kStep);
      for (std::size_t i = 0; i < animation.places.size(); ++i) {
        const PanelPlace& a = animation.places[i];
        EXPECT_GE(a.left, 0.0);
        EXPECT_GE(a.top, kPanelTitleHeight);
        EXPECT_LE(a.left + a.width, animation.width);
        EXPECT_LE(a.top + a.height + kPanelCaptionHeight, animation.height - kAnimationFooter);
        for (std::size_t k = 0; k < i; ++k) {
          const PanelPlace& b = animation.places[k];
          EXPECT_TRUE(a.left >= b.left + b.width || a.top >= b.top + b.height + kPanelTitleHeight);
        }
      }
    }
  }
}

// ---- The SVG

std::vector<std::string> SplitAt(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

/// All elements of a name below `node`.
void Collect(const tinyxml2::XMLElement* node, const std::string& name,
             std::vector<const tinyxml2::XMLElement*>& found) {
  for (; node != nullptr; node = node->NextSiblingElement()) {
    if (node->Name() == name) found.push_back(node);
    Collect(node->FirstChildElement(), name, found);
  }
}

Animation MovingAnimation(double speed) {
  base::Random random(3);
  const CourseSet set{"m", {test::WithMoving(*OpenCourse("a"), 6, random), OpenCourse("b")}};
  EpisodeTrack with_scans = Wind("b", 2, 40, env::Outcome::kCollision);
  with_scans.beams = TrackBeams{{0.12, 0.0}, -2.0, 0.5};
  with_scans.scans_cm.assign(40, {100, 200, 300, 200, 100});
  return PlaceAnimation(MakePanels(set, {Wind("a", 1, 90), with_scans}, "x"),
                        {.speed = speed, .shows_scans = true});
}

TEST(AnimationSvg, IsWellFormedAndEveryTimingIsWhole) {
  const std::string text = PrintAnimationSvg(MovingAnimation(2.0));
  tinyxml2::XMLDocument document;
  ASSERT_EQ(document.Parse(text.c_str()), tinyxml2::XML_SUCCESS) << document.ErrorStr();
  EXPECT_THAT(text, Not(HasSubstr("<script")));
  EXPECT_THAT(text, Not(HasSubstr("href")));
  std::vector<const tinyxml2::XMLElement*> timed;
  for (const char* name : {"animate", "animateTransform"}) {
    Collect(document.RootElement(), name, timed);
  }
  EXPECT_GT(timed.size(), 15u);
  for (const tinyxml2::XMLElement* element : timed) {
    EXPECT_STREQ(element->Attribute("dur"), "6.95s");  // 8.9 s of driving at twice the speed + hold
    EXPECT_STREQ(element->Attribute("repeatCount"), "indefinite");
    const auto times = SplitAt(element->Attribute("keyTimes"), ';');
    const auto values = SplitAt(element->Attribute("values"), ';');
    ASSERT_EQ(times.size(), values.size()) << element->Attribute("values");
    EXPECT_EQ(std::stod(times.front()), 0.0);
    EXPECT_EQ(std::stod(times.back()), 1.0);
    for (std::size_t i = 1; i < times.size(); ++i) {
      EXPECT_LE(std::stod(times[i - 1]), std::stod(times[i]));
    }
  }
}

TEST(AnimationSvg, MarksOfTheGuardAppearWhenTheRobotIsThere) {
  EpisodeTrack track = Wind("a", 1, 50);
  track.interventions = {10, 25};
  const Animation animation =
      PlaceAnimation(MakePanels(OpenSet(), {track, Wind("b", 2, 50)}, "x"), {});
  EXPECT_EQ(CaptionOf(animation.panels[0]), "success 4.9 s; rings: guard");
  EXPECT_EQ(CaptionOf(animation.panels[1]), "success 4.9 s");
  tinyxml2::XMLDocument document;
  ASSERT_EQ(document.Parse(PrintAnimationSvg(animation).c_str()), tinyxml2::XML_SUCCESS);
  std::vector<const tinyxml2::XMLElement*> circles;
  Collect(document.RootElement(), "circle", circles);
  std::vector<double> times;
  const PanelPlace& place = animation.places[0];
  for (const tinyxml2::XMLElement* circle : circles) {
    const auto* appears = circle->FirstChildElement("animate");
    if (appears == nullptr) continue;
    const double time = std::stod(SplitAt(appears->Attribute("keyTimes"), ';')[1]);
    times.push_back(time * animation.loop_time());
    const base::Vec2 p = PoseAt(track, times.back()).p;
    EXPECT_NEAR(circle->DoubleAttribute("cx"), animation.scale * (p.x - place.view.min_W.x), 0.1);
    EXPECT_NEAR(circle->DoubleAttribute("cy"), animation.scale * (place.view.max_W.y - p.y), 0.1);
  }
  ASSERT_EQ(times.size(), 2u);
  EXPECT_NEAR(times[0], 1.0, 1e-4);
  EXPECT_NEAR(times[1], 2.5, 1e-4);
}

TEST(AnimationSvg, TheRobotIsWhereItWas) {
  constexpr double kSpeed = 2.0;
  const Animation animation = MovingAnimation(kSpeed);
  tinyxml2::XMLDocument document;
  document.Parse(PrintAnimationSvg(animation).c_str());
  std::vector<const tinyxml2::XMLElement*> rects;
  Collect(document.RootElement(), "rect", rects);
  std::size_t panel = 0;
  for (const tinyxml2::XMLElement* rect : rects) {
    if (!rect->Attribute("class", "robot")) continue;
    const auto* group = rect->Parent()->Parent()->ToElement();
    const auto* motion = group->FirstChildElement("animateTransform");
    const auto times = SplitAt(motion->Attribute("keyTimes"), ';');
    const auto values = SplitAt(motion->Attribute("values"), ';');
    const EpisodeTrack& track = animation.panels[panel].tracks.front();
    const PanelPlace& place = animation.places[panel++];
    for (std::size_t i = 0; i < times.size(); ++i) {
      const auto point = SplitAt(values[i], ' ');
      const base::Pose2 pose = PoseAt(track, std::stod(times[i]) * animation.loop_time() * kSpeed);
      EXPECT_NEAR(std::stod(point[0]), animation.scale * (pose.p.x - place.view.min_W.x), 0.2);
      EXPECT_NEAR(std::stod(point[1]), animation.scale * (place.view.max_W.y - pose.p.y), 0.2);
    }
  }
  EXPECT_EQ(panel, 2u);
}

// ---- Frames

Colour PixelAt(std::span<const std::byte> frame, int width, double x, double y) {
  const std::size_t at = 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                              static_cast<std::size_t>(x));
  const auto part = [&](std::size_t i) { return std::to_integer<int>(frame[at + i]) / 255.0; };
  return {part(2), part(1), part(0)};
}

TEST(AnimationFrames, TheRobotIsWhereItWasAndTakesTheOutcomesColourAtTheEnd) {
  EpisodeTrack driven = Wind("a", 1, 60, env::Outcome::kCollision);
  driven.interventions = {30};
  const Animation animation =
      PlaceAnimation(MakePanels(OpenSet(), {driven}, "x"), {.speed = 2.0, .hold = 1.0});
  AnimationFrames frames(animation);
  ASSERT_EQ(frames.width(), animation.width);
  ASSERT_EQ(frames.height(), animation.height);
  const EpisodeTrack& track = animation.panels[0].tracks[0];
  const PanelPlace& place = animation.places[0];
  const auto colour_at = [&](double time, base::Vec2 p_R) {
    const base::Vec2 p = base::Transform(PoseAt(track, 2.0 * time), p_R);
    return PixelAt(frames.Draw(time), frames.width(),
                   place.left + animation.scale * (p.x - place.view.min_W.x),
                   place.top + animation.scale * (place.view.max_W.y - p.y));
  };
  const base::Vec2 on_body{0.0, 0.16};
  const base::Vec2 beside{0.0, 0.27};
  for (const double time : {0.0, 1.0, 2.5}) {
    EXPECT_NEAR(colour_at(time, on_body).blue, 0.83, 0.03) << time;
    EXPECT_GT(colour_at(time, beside).red, 0.4) << time;
  }
  const auto mark_at = [&](double time) {
    const base::Vec2 p_R = base::InverseTransform(PoseAt(track, 2.0 * time), track.poses[30].p);
    return colour_at(time, p_R).red;
  };
  EXPECT_LT(mark_at(1.45), 0.99) << "the floor, just before the robot is there";
  EXPECT_GT(mark_at(2.5), 0.99) << "a guard's ring is white inside";
  const Colour red = OutcomeColour(env::Outcome::kCollision);
  const Colour end = colour_at(3.4, on_body);
  EXPECT_NEAR(end.red, red.red, 0.03);
  EXPECT_NEAR(end.blue, red.blue, 0.03);
}

}  // namespace
}  // namespace slalom::sim
