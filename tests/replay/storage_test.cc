#include "replay/storage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/file.h"
#include "replay/manifest.h"
#include "tests/replay/model.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/small_files.h"

namespace slalom::replay {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kBeams = 3;

class StorageTest : public testing::Test {
 protected:
  StorageTest() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    directory_ = fs::path(testing::TempDir()) /
                 (std::string("slalom_storage_") + info->name() + "_" + std::to_string(::getpid()));
    fs::remove_all(directory_);
  }
  ~StorageTest() override { fs::remove_all(directory_); }

  std::vector<fs::path> Files() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(directory_)) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
  }

  /// What `Load` throws; empty: nothing.
  std::string LoadError(std::string_view manifest) const {
    try {
      (void)Storage(directory_).Load(manifest);
      return "";
    } catch (const base::Error& error) {
      return error.what();
    }
  }

  fs::path directory_;
};

void ExpectSameDraws(const Table& a, const Table& b, const SampleSpec& spec) {
  ASSERT_EQ(a.total_inserted(), b.total_inserted());
  ASSERT_EQ(a.first_sequence(), b.first_sequence());
  ASSERT_EQ(a.num_steps(), b.num_steps());
  base::Random random_a(1);
  base::Random random_b(1);
  Batch batch_a;
  Batch batch_b;
  for (int i = 0; i < 3; ++i) {
    const bool any = a.Sample(spec, random_a, &batch_a);
    ASSERT_EQ(any, b.Sample(spec, random_b, &batch_b));
    ASSERT_EQ(random_a.state(), random_b.state());
    if (!any) return;
    ASSERT_EQ(batch_a.rows.sequence, batch_b.rows.sequence);
    ASSERT_EQ(batch_a.rows.next_sequence, batch_b.rows.next_sequence);
    const auto same = [](const auto& x, const auto& y) {
      return std::equal(x.data(), x.data() + x.size(), y.data(), y.data() + y.size());
    };
    EXPECT_TRUE(same(batch_a.ranges_cm, batch_b.ranges_cm));
    EXPECT_TRUE(same(batch_a.next_ranges_cm, batch_b.next_ranges_cm));
    EXPECT_TRUE(same(batch_a.rows.state, batch_b.rows.state));
    EXPECT_TRUE(same(batch_a.rows.next_state, batch_b.rows.next_state));
    EXPECT_TRUE(same(batch_a.rows.action, batch_b.rows.action));
    EXPECT_TRUE(same(batch_a.rows.n_step_return, batch_b.rows.n_step_return));
    EXPECT_TRUE(same(batch_a.rows.cost_return, batch_b.rows.cost_return));
    EXPECT_TRUE(same(batch_a.rows.discount, batch_b.rows.discount));
  }
}

// Saved, loaded and carried on with at random moments, a table is the one that was never saved.
class RestoredTable : public StorageTest, public testing::WithParamInterface<env::StepShape> {};

TEST_P(RestoredTable, DrawsAndGoesOnAsTheOriginal) {
  constexpr std::int64_t kCapacity = 400;
  const SampleSpec spec{.batch = 70, .history = 4, .n_step = 4, .gamma = 0.9};
  ReplayModel model(kCapacity, GetParam(), 6, 21);
  ReplayModel twin(kCapacity, GetParam(), 6, 21);
  Table table({.capacity = kCapacity}, GetParam());
  Table restored({.capacity = kCapacity}, GetParam());
  auto storage = std::make_unique<Storage>(directory_);
  base::Random random(4);
  std::vector<std::string> manifests;
  for (int i = 0; i < 500; ++i) {
    model.Advance(&table);
    twin.Advance(&restored);
    // Rarely for a while, so that whole saves are overwritten in the table between two of them.
    if (random.Uniform() < (i < 250 ? 0.1 : 0.01)) {
      manifests.push_back(storage->Save(restored));
      if (random.Uniform() < 0.5) storage->Commit(std::span(manifests).last(1));
      storage = std::make_unique<Storage>(directory_);
      restored = storage->Load(manifests.back());
      ExpectSameDraws(table, restored, spec);
    }
    if (i % 10 == 0) ExpectSameDraws(table, restored, spec);
    ASSERT_FALSE(HasFailure()) << "after " << i << " batch steps";
  }
  EXPECT_GT(manifests.size(), 10u);
}

INSTANTIATE_TEST_SUITE_P(Shapes, RestoredTable,
                         testing::Values(env::StepShape(kBeams), env::StepShape(0, 3, 1),
                                         env::StepShape(kBeams, 17, 6)));

TEST_F(StorageTest, ASaveWritesOnlyWhatIsNewAndCommitDeletesWhatIsOld) {
  ReplayModel model(200, kBeams, 4, 1);
  Table table({.capacity = 200}, kBeams);
  Storage storage(directory_);
  for (int i = 0; i < 20; ++i) model.Advance(&table);
  const std::string first = storage.Save(table);
  model.Advance(&table);
  const std::string second = storage.Save(table);
  ASSERT_EQ(Files().size(), 2u);
  EXPECT_LT(fs::file_size(Files()[1]), fs::file_size(Files()[0]) / 5);
  for (int i = 0; i < 60; ++i) model.Advance(&table);
  const std::string third = storage.Save(table);

  // Uncommitted, all three can be loaded.
  for (const std::string& manifest : {first, second, third}) EXPECT_EQ(LoadError(manifest), "");
  storage.Commit(std::vector{second, third});
  EXPECT_EQ(LoadError(second), "");
  storage.Commit(std::vector{third});
  EXPECT_EQ(LoadError(third), "");
  EXPECT_THAT(LoadError(first), HasSubstr("replay-000000.rows"));
  ASSERT_EQ(Files().size(), 1u);
}

// A disk that fills up must not stay full of rows that no manifest names.
TEST_F(StorageTest, ASaveThatFailsLeavesNothing) {
  constexpr int kRows = 40000;  // More than a part file holds.
  const std::vector<std::uint16_t> scan(kBeams, 1);
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  Table table({.capacity = kRows}, kBeams);
  Chunk chunk(kBeams);
  for (int i = 0; i < kRows; ++i) chunk.AddStep(0, i == 0, frame, {}, {});
  table.Insert(chunk);
  Storage storage(directory_);
  {
    const test::ScratchDirectory scratch;
    const test::FailingCalls full(
        {.function = "write", .path = "*/replay-000001.rows.tmp", .error = ENOSPC},
        scratch.path() / "calls");
    EXPECT_THROW(static_cast<void>(storage.Save(table)), base::Error);
    EXPECT_EQ(full.num_calls(), 1);
  }
  EXPECT_TRUE(Files().empty());
  EXPECT_EQ(LoadError(storage.Save(table)), "");
}

// Most often an empty list is a fault of whoever made it.
TEST_F(StorageTest, NoManifestsAreNoReasonToDeleteAll) {
  ReplayModel model(200, kBeams, 4, 1);
  Table table({.capacity = 200}, kBeams);
  Storage storage(directory_);
  for (int i = 0; i < 20; ++i) model.Advance(&table);
  const std::string manifest = storage.Save(table);
  EXPECT_THROW(storage.Commit({}), base::Error);
  EXPECT_EQ(LoadError(manifest), "");
  storage.DeleteAll();
  EXPECT_FALSE(fs::exists(directory_));
}

// The disk may hold no more than the table and the overwritten rows of a single part file.
TEST_F(StorageTest, RowsThatAreOverwrittenLeaveTheDiskFileByFile) {
  constexpr std::int64_t kCapacity = 100000;
  constexpr std::int64_t kMostRows = 32768;  // In a part file (docs/replay.md).
  const std::vector<std::uint16_t> scan(kBeams, 1);
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  Table table({.capacity = kCapacity}, kBeams);
  Storage storage(directory_);
  Chunk chunk(kBeams);
  const auto save = [&](int rows) {
    chunk.Clear();
    for (int i = 0; i < rows; ++i) chunk.AddStep(0, table.total_inserted() + i == 0, frame, {}, {});
    table.Insert(chunk);
    const std::string manifest = storage.Save(table);
    storage.Commit(std::vector{manifest});
    EXPECT_EQ(LoadError(manifest), "");
    std::int64_t bytes = 0;
    for (const fs::path& file : Files()) bytes += static_cast<std::int64_t>(fs::file_size(file));
    return bytes;
  };
  const double full = static_cast<double>(save(kCapacity));
  EXPECT_EQ(Files().size(), 4u);
  const double most = full * static_cast<double>(kCapacity + kMostRows) / kCapacity;
  EXPECT_LE(static_cast<double>(save(80000)), most);
  EXPECT_LE(static_cast<double>(save(17)), most);
}

TEST_F(StorageTest, CutAndLongSilentStreamsComeBackAsTheyWere) {
  const std::vector<std::uint16_t> scan(kBeams, 1);
  const std::vector<float> state(env::kStateSize, 0.0f);
  const env::FrameView frame{scan, state};
  Table table({.capacity = 20}, kBeams);
  Chunk chunk(kBeams);
  chunk.AddStep(0, true, frame, {}, {});  // Open and silent until it is overwritten.
  for (int i = 0; i < 30; ++i) chunk.AddStep(1, i == 0, frame, {}, {});
  table.Insert(chunk);
  table.Cut(1);
  Storage storage(directory_);
  Table restored = storage.Load(storage.Save(table));
  EXPECT_TRUE(restored.is_open(0));
  EXPECT_FALSE(restored.is_open(1));
  chunk.Clear();
  chunk.AddStep(1, true, frame, {}, {});
  chunk.AddStep(0, false, frame, {}, {});
  chunk.AddStep(0, false, frame, {}, {});
  table.Insert(chunk);
  restored.Insert(chunk);
  ExpectSameDraws(table, restored, {.batch = 64, .history = 2, .n_step = 1});
  // 16 of the 17 rows left of stream 1 have a next one, and all but the oldest one before; stream 0
  // has one step with a next, but what was before it is lost.
  EXPECT_EQ(restored.CountEligible(2, 1), 15);
  EXPECT_EQ(restored.CountEligible(1, 1), 17);
}

TEST_F(StorageTest, AnEmptyTableCanBeSaved) {
  Storage storage(directory_);
  const Table table({.capacity = 200}, kBeams);
  EXPECT_EQ(storage.Load(storage.Save(table)).total_inserted(), 0);
}

TEST_F(StorageTest, EveryTruncationAndEveryChangedByteIsNoticed) {
  ReplayModel model(200, kBeams, 2, 1);
  Table table({.capacity = 200}, kBeams);
  for (int i = 0; i < 8; ++i) model.Advance(&table);
  const std::string manifest = Storage(directory_).Save(table);
  const fs::path file = Files().at(0);
  const std::string content = base::ReadFile(file);
  const auto expect_noticed = [&](const std::string& damaged) {
    std::ofstream(file, std::ios::binary) << damaged;
    EXPECT_THAT(LoadError(manifest), HasSubstr(file.string()));
  };
  for (std::size_t size = 0; size < content.size(); ++size) expect_noticed(content.substr(0, size));
  for (std::size_t i = 0; i < content.size(); ++i) {
    std::string damaged = content;
    damaged[i] ^= 1;
    expect_noticed(damaged);
  }
  expect_noticed(content + '\0');
  fs::remove(file);
  EXPECT_THAT(LoadError(manifest), HasSubstr(file.string()));
}

TEST_F(StorageTest, EveryTruncationAndEveryChangedByteOfAManifestIsNoticed) {
  ReplayModel model(200, kBeams, 2, 1);
  Table table({.capacity = 200}, kBeams);
  for (int i = 0; i < 8; ++i) model.Advance(&table);
  const std::string manifest = Storage(directory_).Save(table);
  EXPECT_EQ(PrintManifest(ParseManifest(manifest)), manifest);
  for (std::size_t i = 0; i < manifest.size(); ++i) {
    EXPECT_THROW(ParseManifest(manifest.substr(0, i)), base::Error);
    std::string damaged = manifest;
    damaged[i] ^= 1;
    EXPECT_THROW(ParseManifest(damaged), base::Error);
  }
}

TEST(ManifestTest, ComesBackWhateverOfItIsNotTheUsual) {
  for (const int state_size : {env::kStateSize, env::kStateSize + 3}) {
    for (const int action_size : {env::kActionSize, env::kActionSize + 1}) {
      Manifest manifest{.shape = kBeams, .capacity = 50, .begin = 7, .end = 40, .open = {1, 0, 0}};
      manifest.shape.state_size = state_size;
      manifest.shape.action_size = action_size;
      // The table begins within the first file.
      manifest.part_files = {{"a", 0, 30, 0xfeed}, {"b", 30, 40, 0x1}};
      const std::string text = PrintManifest(manifest);
      const Manifest parsed = ParseManifest(text);
      EXPECT_EQ(PrintManifest(parsed), text);
      EXPECT_EQ(parsed.shape, manifest.shape);
      EXPECT_EQ(parsed.begin, 7);
      EXPECT_EQ(parsed.open, manifest.open);
      EXPECT_EQ(parsed.part_files[1].digest, 0x1u);
    }
  }
}

// Files that do not hold the table's rows, or that stand elsewhere, under a sound checksum.
TEST(ManifestTest, FilesThatDoNotHoldTheRowsAreRefused) {
  using PartFiles = std::vector<Storage::PartFile>;
  const auto print = [](const PartFiles& files) {
    return PrintManifest(
        {.shape = kBeams, .capacity = 50, .begin = 10, .end = 40, .open = {}, .part_files = files});
  };
  EXPECT_NO_THROW(ParseManifest(print({{"a", 10, 20, 0}, {"b", 20, 40, 0}})));
  const std::vector<PartFiles> wrong = {{},
                                        {{"a", 10, 20, 0}, {"b", 21, 40, 0}},
                                        {{"a", 10, 20, 0}, {"b", 19, 40, 0}},
                                        {{"a", 10, 20, 0}, {"b", 20, 39, 0}},
                                        {{"a", 10, 20, 0}, {"b", 20, 41, 0}},
                                        {{"a", 11, 20, 0}, {"b", 20, 40, 0}},
                                        {{"a", 10, 20, 0}, {"b", 20, 20, 0}, {"c", 20, 40, 0}},
                                        {{"a", 10, 20, 0}, {"../b", 20, 40, 0}}};
  for (const PartFiles& files : wrong) {
    EXPECT_THROW(ParseManifest(print(files)), base::Error) << print(files);
  }
}

TEST_F(StorageTest, AnotherPartFileUnderTheSameNameIsNoticed) {
  std::vector<std::string> manifests;
  for (const std::uint64_t seed : {1, 2}) {
    fs::remove_all(directory_);
    Table table({.capacity = 200}, kBeams);
    Chunk chunk(kBeams);
    const std::vector<std::uint16_t> scan(kBeams, static_cast<std::uint16_t>(seed));
    const std::vector<float> state(env::kStateSize, 0.0f);
    chunk.AddStep(0, true, {scan, state}, {}, {});
    table.Insert(chunk);
    manifests.push_back(Storage(directory_).Save(table));
  }
  EXPECT_EQ(LoadError(manifests[1]), "");
  EXPECT_THAT(LoadError(manifests[0]), HasSubstr("not the file that the checkpoint was made with"));
}

TEST_F(StorageTest, AFullDiskLeavesTheEarlierSaveWhole) {
  ReplayModel model(2000, kBeams, 4, 1);
  Table table({.capacity = 2000}, kBeams);
  Storage storage(directory_);
  for (int i = 0; i < 20; ++i) model.Advance(&table);
  const std::string first = storage.Save(table);
  for (int i = 0; i < 200; ++i) model.Advance(&table);
  {
    const test::SmallFiles limit(4096);
    EXPECT_THROW((void)storage.Save(table), base::Error);
  }
  EXPECT_EQ(Files().size(), 1u) << "a half-written file was left";
  EXPECT_EQ(LoadError(first), "");
  // With room again, the same storage goes on.
  Table restored = Storage(directory_).Load(storage.Save(table));
  ExpectSameDraws(table, restored, {.batch = 64, .history = 4, .n_step = 4});
}

TEST_F(StorageTest, ADirectoryThatCannotBeMadeIsNamed) {
  base::MakeDirectories(directory_);
  const fs::path file = directory_ / "file";
  std::ofstream(file) << "x";
  try {
    Storage storage(file / "replay");
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(file.string()));
  }
}

}  // namespace
}  // namespace slalom::replay
