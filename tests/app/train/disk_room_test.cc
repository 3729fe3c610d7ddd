#include "app/train/disk_room.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "base/error.h"
#include "replay/storage.h"
#include "tests/support/scratch_directory.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr int kBeams = 4;

RunConfig Config(std::int64_t capacity, std::int64_t interval, std::int64_t steps) {
  RunConfig config;
  config.environment.lidar.num_beams = kBeams;
  config.replay.capacity = capacity;
  config.run.deterministic = true;
  config.run.checkpoint_steps = interval;
  config.run.max_steps = steps;
  return config;
}

/// The most bytes that are in `directory` at once while a run of this config saves its replay.
std::int64_t MeasurePeak(const RunConfig& config, const fs::path& directory) {
  const std::vector<std::uint16_t> scan(kBeams, 1);
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  replay::Table table(config.replay, kBeams);
  replay::Storage storage(directory);
  std::vector<std::string> manifests;
  std::int64_t peak = 0;
  while (table.total_inserted() < config.run.max_steps) {
    const std::int64_t left = config.run.max_steps - table.total_inserted();
    const std::int64_t interval = config.run.checkpoint_steps;
    replay::Chunk chunk(kBeams);
    for (std::int64_t i = interval > 0 ? std::min(left, interval) : left; i > 0; --i) {
      chunk.AddStep(0, table.total_inserted() + chunk.num_rows() == 0, frame, {}, {});
    }
    table.Insert(chunk);
    manifests.push_back(storage.Save(table));
    std::int64_t bytes = 0;
    for (const auto& entry : fs::directory_iterator(directory)) {
      bytes += static_cast<std::int64_t>(entry.file_size());
    }
    peak = std::max(peak, bytes);
    storage.Commit(std::span(manifests).last(std::min<std::size_t>(manifests.size(), 2)));
  }
  return peak;
}

TEST(DiskRoomTest, TheEstimateHoldsWhatARunReallyWrites) {
  struct Run {
    std::int64_t capacity, interval, steps;
  };
  for (const Run& run : {Run{50000, 0, 30000}, Run{50000, 0, 200000}, Run{50000, 10000, 35000},
                         Run{50000, 10000, 200000}, Run{50000, 70000, 300000},
                         Run{50000, 70000, 150000}, Run{50000, 40000, 100000}}) {
    SCOPED_TRACE(testing::Message() << run.capacity << " " << run.interval << " " << run.steps);
    const test::ScratchDirectory scratch;
    const RunConfig config = Config(run.capacity, run.interval, run.steps);
    const std::int64_t peak = MeasurePeak(config, scratch.path() / "replay");
    const ReplayBytes estimate = CheckpointReplayBytes(config);
    constexpr std::int64_t kHeaders = 40 * 12;  // Of the part files.
    EXPECT_LE(estimate.least, peak);
    EXPECT_GE(estimate.most + kHeaders, peak);
  }
}

TEST(DiskRoomTest, WhatTheClockDecidesIsNotCertain) {
  RunConfig config = Config(50000, 10000, 1000000);
  const ReplayBytes by_steps = CheckpointReplayBytes(config);
  EXPECT_EQ(by_steps.least, replay::Storage::BytesOfRows(kBeams, 70000));
  // Other checkpoints may come between.
  config.run.deterministic = false;
  EXPECT_EQ(CheckpointReplayBytes(config).least, replay::Storage::BytesOfRows(kBeams, 50000));
  EXPECT_EQ(CheckpointReplayBytes(config).most, by_steps.most);
  // The run may end before its replay is full.
  config.run.checkpoint_steps = 0;
  config.run.max_seconds = 60.0;
  config.run.learning_starts = 1000;
  EXPECT_EQ(CheckpointReplayBytes(config).least, replay::Storage::BytesOfRows(kBeams, 1000));
  EXPECT_GE(CheckpointReplayBytes(config).most, replay::Storage::BytesOfRows(kBeams, 150000));
}

TEST(DiskRoomTest, ARunThatCannotFitIsRefusedWithTheKeysToChange) {
  const test::ScratchDirectory scratch;
  const run::RunDirectory directory{scratch.path() / "not" / "there"};
  RunConfig config = Config(1000, 0, 2000);
  EXPECT_NO_THROW(RequireRoom(config, directory, 1000));
  const auto free = static_cast<std::int64_t>(fs::space(scratch.path()).available);
  const auto refused = [&](const char* text) {
    return testing::ThrowsMessage<base::Error>(testing::AllOf(
        testing::HasSubstr(directory.root.string() + ": "), testing::HasSubstr("are free"),
        testing::HasSubstr("replay.capacity = "), testing::HasSubstr(text)));
  };
  // By the learner, or by the replay.
  EXPECT_THAT([&] { RequireRoom(config, directory, 2 * free); }, refused("run.checkpoint_steps"));
  config.replay.capacity = config.run.max_steps = free / (2 * kBeams);
  EXPECT_THAT([&] { RequireRoom(config, directory, 0); }, refused("run.checkpoint_steps"));
  EXPECT_FALSE(fs::exists(directory.root.parent_path()));
}

}  // namespace
}  // namespace slalom::train
