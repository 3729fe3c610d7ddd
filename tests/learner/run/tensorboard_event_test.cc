// The bytes of events, put together by hand from the field numbers and types of TensorBoard's
// format.

#include <gtest/gtest.h>

#include <limits>

#include "learner/run/event_file.h"

namespace slalom::run {
namespace {

using namespace std::string_literals;

// Field 1, a double of 1.0: what every event here begins with.
const std::string kOne = "\x09\0\0\0\0\0\0\xf0\x3f"s;

TEST(TensorboardEventTest, TheFirstEventHoldsTheVersion) {
  EXPECT_EQ(EncodeVersionEvent(1.0), kOne + "\x10\x00\x1a\x0d"s + "brain.Event:2");
}

TEST(TensorboardEventTest, ASessionStartNamesItsStep) {
  EXPECT_EQ(EncodeSessionStart(1.0, 300), kOne + "\x10\xac\x02\x3a\x02\x08\x01");
}

TEST(TensorboardEventTest, FiniteScalarsAreFloats) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Scalar scalars[] = {{"a", 0.5}, {"unknown", nan}, {"beyond", 1e300}, {"bc", 0.0}};
  // Of a summary (5) two values (1): tag (1) and float (2), which is written if it is 0, too.
  EXPECT_EQ(EncodeScalars(1.0, 7, scalars), kOne + "\x10\x07\x2a\x15"s +
                                                "\x0a\x08\x0a\x01"
                                                "a"
                                                "\x15\0\0\0\x3f"s +
                                                "\x0a\x09\x0a\x02"
                                                "bc"
                                                "\x15\0\0\0\0"s);
  EXPECT_EQ(EncodeScalars(1.0, 7, {}), kOne + "\x10\x07\x2a\x00"s);
}

}  // namespace
}  // namespace slalom::run
