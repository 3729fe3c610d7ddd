#include "learner/run/event_file.h"

#include <gmock/gmock.h>

#include <chrono>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/event_file_reader.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

double Now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// The check value of the CRC catalogue, and RFC 3720 B.4: 32 bytes of zero.
TEST(EventFileReaderTest, ItsCrcIsCastagnolis) {
  EXPECT_EQ(test::Crc32c("123456789"), 0xe3069283u);
  EXPECT_EQ(test::Crc32c(std::string(32, '\0')), 0x8a9136aau);
}

TEST(EventFileTest, EveryRecordIsWhatWasWritten) {
  const test::ScratchDirectory scratch;
  const double before = Now();
  EventFile file(scratch.path(), 1);
  // Lengths of one and of two bytes, numbers of one byte and of ten.
  const std::string long_tag(300, 't');
  const std::vector<Scalar> first = {{"a", 0.5}, {"b/c", -1e30}, {long_tag, 16777217.0}};
  EXPECT_FALSE(file.Append(127, first));
  EXPECT_FALSE(file.Append(std::int64_t{1} << 40, std::vector<Scalar>{{"a", 0.1}}));
  const double after = Now();

  const std::vector<test::Event> events = test::ReadEvents(file.path());
  ASSERT_EQ(events.size(), 4u);
  EXPECT_EQ(events[0].file_version, "brain.Event:2");
  EXPECT_EQ(events[1].session_status, 1);
  EXPECT_EQ(events[1].step, 1);
  EXPECT_EQ(events[2].step, 127);
  EXPECT_THAT(events[2].scalars,
              ElementsAre(Pair("a", 0.5f), Pair("b/c", -1e30f), Pair(long_tag, 16777216.0f)));
  EXPECT_EQ(events[3].step, std::int64_t{1} << 40);
  EXPECT_THAT(events[3].scalars, ElementsAre(Pair("a", 0.1f)));
  for (const test::Event& event : events) {
    EXPECT_GE(event.wall_time, before);
    EXPECT_LE(event.wall_time, after);
  }
}

TEST(EventFileTest, WhatIsNotFiniteIsLeftOut) {
  const test::ScratchDirectory scratch;
  EventFile file(scratch.path(), 1);
  EXPECT_FALSE(
      file.Append(5, std::vector<Scalar>{{"nan", std::numeric_limits<double>::quiet_NaN()},
                                         {"infinite", std::numeric_limits<double>::infinity()},
                                         {"beyond float", 1e300},
                                         {"finite", 2.0}}));
  EXPECT_THAT(test::ReadEvents(file.path()).back().scalars, ElementsAre(Pair("finite", 2.0f)));
}

// The reader of these tests finds what it is there to find: any bit that is turned in any byte.
TEST(EventFileTest, AnyDamageIsSeen) {
  const test::ScratchDirectory scratch;
  EventFile file(scratch.path(), 1);
  EXPECT_FALSE(file.Append(5, std::vector<Scalar>{{"a", 1.0}}));
  const std::string whole = base::ReadFile(file.path());
  const auto damaged = scratch.path() / "damaged";
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string bytes = whole;
    bytes[i] = static_cast<char>(bytes[i] ^ 1 << i % 8);
    base::WriteFileAtomically(damaged, bytes);
    EXPECT_THROW(test::ReadEvents(damaged), std::runtime_error) << "byte " << i;
  }
  base::WriteFileAtomically(damaged, whole.substr(0, whole.size() - 1));
  EXPECT_THROW(test::ReadEvents(damaged), std::runtime_error);
}

TEST(EventFileTest, AResumedRunsFileComesLaterAndSupersedes) {
  const test::ScratchDirectory scratch;
  const auto append = [](EventFile& file, std::int64_t step, double value) {
    EXPECT_FALSE(file.Append(step, std::vector<Scalar>{{"a", value}}));
  };
  // Made within one second, as by a run that was killed at once; and one of a clock set back since.
  base::WriteFileAtomically(scratch.path() / "events.out.tfevents.9999999990.slalom", "");
  EventFile first(scratch.path(), 1);
  for (const int step : {100, 200, 300}) append(first, step, 1.0);
  EventFile second(scratch.path(), 201);  // From a checkpoint at 200.
  for (const int step : {250, 350}) append(second, step, 2.0);
  EXPECT_LT(first.path().filename().string(), second.path().filename().string());

  std::vector<std::pair<std::int64_t, float>> shown;
  for (const test::Event& event : test::ReadRun(scratch.path())) {
    shown.emplace_back(event.step, event.scalars.at("a"));
  }
  EXPECT_THAT(shown,
              ElementsAre(Pair(100, 1.0f), Pair(200, 1.0f), Pair(250, 2.0f), Pair(350, 2.0f)));
}

TEST(EventFileTest, AnUnwritablePlaceIsNamed) {
  try {
    const EventFile file("/nonexistent", 1);
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/events.out.tfevents."));
  }
}

}  // namespace
}  // namespace slalom::run
