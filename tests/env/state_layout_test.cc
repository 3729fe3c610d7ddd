#include "env/state_layout.h"

#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <vector>

#include "env/observation.h"

namespace slalom::env {
namespace {

constexpr StateOptions kAll{
    .speeds = true, .mounting = true, .commands = 3, .tracked = true, .privileged = true};

TEST(StateLayoutTest, SizesAreThoseOfTheOptions) {
  EXPECT_EQ(kStateSize, 4);
  EXPECT_EQ(ObservationSpec{}.size(), 724);
  EXPECT_EQ(StateSize({.speeds = true}), 6);
  EXPECT_EQ(StateSize({.mounting = true}), 6);
  EXPECT_EQ(StateSize({.commands = 16}), 34);
  EXPECT_EQ(StateSize({.tracked = true}), 4 + 5 * 4);
  EXPECT_EQ(StateSize({.privileged = true}), 4 + 2 + 5 * 4 + 6);
  EXPECT_EQ(StateSize(kAll), 4 + 2 + 2 + 4 + 20 + 28);
}

// Policies on disk depend on this order, and on these scales.
TEST(StateLayoutTest, FieldsStandInTheirPlacesInTheirScales) {
  const ActionBounds bounds{.linear_min = -1.0, .linear_max = 3.0, .angular_max = 2.0};
  const StateWriter writer(kAll, bounds);
  std::vector<float> state(60, -99.0f);
  const auto write = [&](std::size_t field, const auto& values) {
    writer.Write(field, values, state);
  };
  write(FieldOf("drive"), std::array{0.1, 0.05, -0.25, 0.5, 10.0, 50.0});
  std::array<double, 20> obstacles{};
  std::iota(obstacles.begin(), obstacles.end(), 1.0);
  write(FieldOf("nearest obstacle"), obstacles);
  write(FieldOf("tracked obstacle"), std::vector<double>(20, 5.0));
  write(FieldOf("true speeds"), std::array{5.0, -3.0});
  write(FieldOf("earlier action"), std::array{0.5f, -0.5f, 0.75f, 1.0f});
  write(FieldOf("mounting"), std::array{0.12, -0.03});
  write(FieldOf("speeds"), std::array{2.0, 1.0});
  write(FieldOf("last action"), std::array{0.25f, -0.125f});
  write(FieldOf("goal"), std::array{7.0, -2.0});
  const std::vector<float> expected = {
      7.0f,  -2.0f, 0.25f, -0.125f, 0.5f,  0.5f,  1.2f, -0.3f, 0.5f,  -0.5f, 0.75f, 1.0f,
      1.0f,  1.0f,  5.0f,  5.0f,    1.0f,  1.0f,  5.0f, 5.0f,  1.0f,  1.0f,  5.0f,  5.0f,
      1.0f,  1.0f,  5.0f,  5.0f,    1.0f,  1.0f,  5.0f, 5.0f,  2.0f,  -1.5f, 0.2f,  0.4f,
      3.0f,  4.0f,  1.0f,  1.2f,    7.0f,  8.0f,  1.8f, 2.0f,  11.0f, 12.0f, 2.6f,  2.8f,
      15.0f, 16.0f, 3.4f,  3.6f,    19.0f, 20.0f, 1.0f, 0.5f,  -2.5f, 5.0f,  0.5f,  2.0f};
  EXPECT_EQ(state, expected);
}

TEST(StateLayoutTest, WhatAStateDoesNotHoldIsNotWritten) {
  const StateWriter writer({}, {});
  std::vector<float> state(4, -99.0f);
  writer.Write(FieldOf("mounting"), std::array{1.0, 2.0}, state);
  writer.Write(FieldOf("earlier action"), std::vector<float>{}, state);
  writer.Write(FieldOf("goal"), std::array{1.0, 2.0}, state);
  EXPECT_EQ(state, (std::vector<float>{1.0f, 2.0f, -99.0f, -99.0f}));
}

// Lateral places, lateral velocities and turns.
TEST(StateLayoutTest, EverySecondNumberHasASideSaveTheDrive) {
  std::vector<bool> has_side;
  ForEachNumber(kAll, [&](const StateField& field, const StateNumber& number) {
    EXPECT_EQ(number.has_side, field.name != "drive" && has_side.size() % 2 == 1) << field.name;
    has_side.push_back(number.has_side);
  });
  EXPECT_EQ(has_side.size(), 60u);
}

}  // namespace
}  // namespace slalom::env
