#include "replay/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "replay/rows.h"
#include "tests/replay/journal_scene.h"
#include "tests/support/failing_calls.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/small_files.h"
#include "tests/support/wait_until.h"

namespace slalom::replay {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr test::FailingCall kFailingSyncs{
    .function = "f*sync", .path = "*", .error = EIO, .last = 1'000'000};

/// The segment files of a directory, in order.
std::map<std::string, std::string> ReadSegments(const fs::path& directory) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(directory)) {
    if (entry.path().extension() == ".log") {
      files[entry.path().filename().string()] = base::ReadFile(entry.path());
    }
  }
  return files;
}

void WriteSegments(const fs::path& directory, const std::map<std::string, std::string>& files) {
  for (const auto& entry : fs::directory_iterator(directory)) fs::remove(entry.path());
  for (const auto& [name, content] : files) {
    std::ofstream(directory / name, std::ios::binary) << content;
  }
}

/// A closed journal of a few segments, none of which has been deleted, and what it holds.
struct Written {
  test::ScratchDirectory scratch;
  JournalScene scene{scratch.path(), 1000, 2500, 11};
  std::map<std::string, std::string> files;
  std::vector<std::string> names;

  Written() {
    scene.Open();
    scene.Append(60);
    scene.Close();
    files = ReadSegments(scratch.path());
    for (const auto& [name, content] : files) names.push_back(name);
  }

  Recovered Recover() { return RecoverJournal(scene.options(), scene.config()); }
};

TEST(JournalTest, WhatWasWrittenComesBack) {
  Written written;
  ASSERT_GE(written.names.size(), 3u);
  ASSERT_EQ(written.names.size(), written.scene.segments().size());
  const Recovered recovered = written.Recover();
  EXPECT_THAT(recovered.notes, IsEmpty());
  EXPECT_EQ(recovered.lost_rows, 0);
  EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions),
            written.scene.marks().back().state);
}

// Killed at any byte: what the last whole record led to, and nothing else, is there.
TEST(JournalTest, CutAtEveryByteGivesAPrefix) {
  Written written;
  const std::string last = written.names.back();
  const std::string whole = written.files[last];
  const std::uint64_t segment = written.names.size() - 1;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    auto files = written.files;
    files[last] = whole.substr(0, size);
    WriteSegments(written.scratch.path(), files);
    const Recovered recovered = written.Recover();
    const JournalScene::Mark* expected = nullptr;
    bool at_end = false;
    for (const auto& mark : written.scene.marks()) {
      const bool there =
          mark.segment < segment || (mark.segment == segment && mark.end <= std::int64_t(size));
      if (there) expected = &mark;
      at_end |= mark.segment == segment && mark.end == std::int64_t(size);
    }
    ASSERT_EQ(JournalScene::Describe(recovered.table, recovered.sessions), expected->state)
        << "cut at " << size;
    ASSERT_EQ(recovered.lost_rows, 0);
    ASSERT_THAT(recovered.notes, SizeIs(at_end ? 0 : 1)) << "cut at " << size;
    // The torn bytes are gone, so that the next start finds nothing to say.
    ASSERT_THAT(written.Recover().notes, IsEmpty()) << "cut at " << size;
  }
}

// Any changed byte is noticed: in the last segment it costs what comes after, in an older one what
// comes before the next segment; never more.
TEST(JournalTest, EveryChangedByteCostsOnlyWhatItMust) {
  Written written;
  base::Random random(7);
  for (int i = 0; i < 1500; ++i) {
    const std::uint64_t segment = random.UniformInt(written.names.size());
    const std::string name = written.names[segment];
    auto files = written.files;
    const std::size_t at = random.UniformInt(files[name].size());
    files[name][at] = static_cast<char>(files[name][at] ^ (1 << random.UniformInt(8)));
    WriteSegments(written.scratch.path(), files);
    SCOPED_TRACE("byte " + std::to_string(at) + " of " + name);
    // A changed version or spec stops the start; the head's checksum makes that a damage, too.
    const Recovered recovered = written.Recover();
    ASSERT_THAT(recovered.notes, SizeIs(1));
    ASSERT_THAT(recovered.notes[0], HasSubstr(name));
    const bool is_last = segment + 1 == written.names.size();
    if (is_last) {
      std::string expected;
      for (const auto& mark : written.scene.marks()) {
        if (mark.segment < segment || mark.end <= std::int64_t(at)) expected = mark.state;
      }
      ASSERT_EQ(JournalScene::Describe(recovered.table, recovered.sessions), expected);
    } else {
      const std::int64_t from = written.scene.segments()[segment + 1].first_row;
      ASSERT_EQ(recovered.table.first_sequence(), from);
      ASSERT_EQ(JournalScene::Describe(recovered.table, recovered.sessions, from + 1),
                JournalScene::Describe(written.scene.table(), written.scene.sessions(), from + 1));
      // Rows with their fixed head, and no more than all before the next segment.
      ASSERT_GT(recovered.lost_rows, 0);
    }
    ASSERT_TRUE(fs::exists(written.scratch.path() / (name + ".damaged")));
    ASSERT_THAT(written.Recover().notes, IsEmpty());
  }
}

// Of pages that were written and not synced a loss of power leaves zeros. That is no damage that
// somebody has to look after.
TEST(JournalTest, AHoleAtTheEndIsALossOfPower) {
  Written written;
  const std::string last = written.names.back();
  const std::uint64_t segment = written.names.size() - 1;
  for (const auto& mark : written.scene.marks()) {
    const auto end = static_cast<std::size_t>(mark.end);
    if (mark.segment != segment || end == written.files[last].size()) continue;
    auto files = written.files;
    std::fill(files[last].begin() + mark.end, files[last].end(), '\0');
    WriteSegments(written.scratch.path(), files);
    const Recovered recovered = written.Recover();
    EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions), mark.state);
    EXPECT_EQ(recovered.lost_rows, 0);
    EXPECT_THAT(recovered.notes, Contains(HasSubstr("a loss of power")));
    // What comes behind a hole is lost with it.
    files[last] =
        written.files[last].substr(0, end) + std::string(2048, '\0') + "a page that was synced";
    WriteSegments(written.scratch.path(), files);
    const Recovered torn = written.Recover();
    EXPECT_EQ(JournalScene::Describe(torn.table, torn.sessions), mark.state);
    EXPECT_EQ(torn.lost_rows, 0);
    EXPECT_GT(torn.unsynced_rows, 0);
  }
}

TEST(JournalTest, AHoleInTheLastSectorIsSeen) {
  Written written;
  const std::string last = written.names.back();
  auto files = written.files;
  constexpr std::size_t kSector = 512;
  std::string& content = files[last];
  content.resize((content.size() + kSector - 1) / kSector * kSector + kSector, 'x');
  content.append(kSector, '\0');
  WriteSegments(written.scratch.path(), files);
  const Recovered recovered = written.Recover();
  EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions),
            written.scene.marks().back().state);
  EXPECT_EQ(recovered.lost_rows, 0);
  EXPECT_GT(recovered.unsynced_rows, 0);
}

TEST(JournalTest, AMissingSegmentIsNoticed) {
  Written written;
  auto files = written.files;
  files.erase(written.names[1]);
  WriteSegments(written.scratch.path(), files);
  const Recovered recovered = written.Recover();
  EXPECT_THAT(recovered.notes, SizeIs(1));
  EXPECT_EQ(recovered.table.first_sequence(), written.scene.segments()[2].first_row);
  EXPECT_EQ(recovered.lost_rows, written.scene.segments()[1].first_row);
  EXPECT_EQ(base::ReadFile(written.scratch.path() / (written.names[0] + ".unused")),
            written.files[written.names[0]]);
  EXPECT_THAT(written.Recover().notes, IsEmpty());
}

TEST(JournalTest, DamagedBytesAreCutOffOnlyWhenTheirCopyIsWritten) {
  Written written;
  const std::string& last = written.names.back();
  auto files = written.files;
  files[last][files[last].size() / 2] ^= 1;
  WriteSegments(written.scratch.path(), files);
  const fs::path copy = written.scratch.path() / (last + ".damaged");
  fs::create_directory(copy);  // In its way.
  EXPECT_THROW(written.Recover(), base::Error);
  EXPECT_EQ(base::ReadFile(written.scratch.path() / last), files[last]);

  fs::remove(copy);
  EXPECT_THAT(written.Recover().notes, SizeIs(1));
  EXPECT_TRUE(files[last].ends_with(base::ReadFile(copy)));
}

// Each damage costs what comes before the segment at which the table begins again.
TEST(JournalTest, TwoMissingSegmentsCostTheRowsOfBoth) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 1000, 2500, 11);
  scene.Open();
  scene.Append(150);
  scene.Close();
  auto files = ReadSegments(scratch.path());
  std::vector<std::string> names;
  for (const auto& [name, content] : files) names.push_back(name);
  ASSERT_GE(names.size(), 6u);
  const auto first_row = [&](std::size_t i) { return scene.segments()[i].first_row; };
  for (const std::size_t i : {1, 3}) {
    ASSERT_LT(first_row(i - 1), first_row(i));
    files.erase(names[i]);
  }
  WriteSegments(scratch.path(), files);
  const Recovered recovered = RecoverJournal(scene.options(), scene.config());
  EXPECT_THAT(recovered.notes, SizeIs(2));
  EXPECT_EQ(recovered.lost_rows, first_row(1) + first_row(3) - first_row(2));
  EXPECT_EQ(recovered.unsynced_rows, 0);
  EXPECT_EQ(recovered.table.first_sequence(), first_row(4));
  EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions, first_row(4) + 1),
            JournalScene::Describe(scene.table(), scene.sessions(), first_row(4) + 1));
  // The next journal counts and deletes those that it is told of.
  ASSERT_EQ(recovered.segments.size(), names.size() - 4);
  for (std::size_t i = 0; i < recovered.segments.size(); ++i) {
    EXPECT_EQ(recovered.segments[i].path.filename(), names[4 + i]);
  }
}

TEST(JournalTest, TwoCutsCostTheRowsBehindBoth) {
  Written written;
  auto files = written.files;
  std::int64_t expected = 0;
  const auto row_bytes = static_cast<std::int64_t>(RowBytes::Size(1, JournalScene::kBeams));
  // The one before the last at its end, and the last in its state, so that nothing begins with it.
  for (std::size_t i = written.names.size() - 2; i < written.names.size(); ++i) {
    std::string& content = files[written.names[i]];
    std::int64_t begin = 0;
    for (const auto& mark : written.scene.marks()) {
      if (mark.segment == i && mark.end + 1000 < std::int64_t(content.size())) begin = mark.end;
    }
    if (i + 1 == written.names.size()) begin = 0;
    content[begin == 0 ? SegmentHead::kBytes + 40 : begin] ^= 1;
    const std::int64_t rows = (std::int64_t(content.size()) - begin) / row_bytes;
    ASSERT_GT(rows, 0);
    expected += rows;
  }
  WriteSegments(written.scratch.path(), files);
  const Recovered recovered = written.Recover();
  EXPECT_THAT(recovered.notes, SizeIs(2));
  EXPECT_EQ(recovered.lost_rows, expected);
  EXPECT_EQ(recovered.unsynced_rows, 0);
}

// What a loss of power leaves where the disk wrote the files in another order: the segment after
// the damaged one holds nothing. The damaged one is then the last, and what stands before stays.
TEST(JournalTest, DamageBeforeSegmentsOfNoUseCostsOnlyWhatComesAfterIt) {
  Written written;
  const std::uint64_t segment = written.names.size() - 2;
  const std::string name = written.names[segment];
  const std::string last = written.names.back();
  const std::string tail = written.files[last];
  std::string other = tail;
  other[SegmentHead::kBytes + 40] ^= 1;  // In its state, under a sound head.
  const std::size_t size = written.files[name].size();
  for (const std::string& rest : {std::string(), tail.substr(0, 30), tail.substr(0, 56), other}) {
    for (std::size_t at = 0; at < size; at += 97) {
      for (const bool torn : {false, true}) {
        SCOPED_TRACE("byte " + std::to_string(at) + ", " + std::to_string(rest.size()) + " after");
        auto files = written.files;
        files[last] = rest;
        files[name][at] = static_cast<char>(files[name][at] ^ 1);
        if (torn) files[name].resize(at);
        WriteSegments(written.scratch.path(), files);
        std::string expected;
        bool at_end = false;
        for (const auto& mark : written.scene.marks()) {
          if (mark.segment < segment || (mark.segment == segment && mark.end <= std::int64_t(at))) {
            expected = mark.state;
          }
          at_end |= mark.segment == segment && mark.end == std::int64_t(at);
        }
        const Recovered recovered = written.Recover();
        ASSERT_EQ(JournalScene::Describe(recovered.table, recovered.sessions), expected);
        ASSERT_THAT(recovered.notes, SizeIs(torn && at_end ? 1 : 2));
        ASSERT_TRUE(torn || fs::exists(written.scratch.path() / (name + ".damaged")));
        ASSERT_THAT(written.Recover().notes, IsEmpty());
      }
    }
  }
}

// Kill after kill: each start goes on where the last whole record stood, over many turns of the
// ring, and segments that are no longer needed go.
TEST(JournalTest, GoesOnAfterEveryKill) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 100, 3000, 5);
  base::Random random(6);
  std::vector<std::string> states = {JournalScene::Describe(Table({.capacity = 100}, 2), {})};
  std::size_t most_files = 0;
  for (int start = 0; start < 40; ++start) {
    scene.Open();
    EXPECT_THAT(states, testing::Contains(JournalScene::Describe(scene.table(), scene.sessions())))
        << "start " << start;
    scene.Append(static_cast<int>(random.UniformInt(60)));
    scene.WaitWritten();
    // What it says of the disk is so once those of no use are deleted.
    if (start % 8 == 7) {
      test::WaitUntil([&] {
        const Journal::Status status = scene.journal().status();
        std::int64_t bytes = 0;
        int num_segments = 0;
        for (const auto& entry : fs::directory_iterator(scratch.path())) {
          if (entry.path().extension() != ".log") continue;
          std::error_code gone;
          bytes += static_cast<std::int64_t>(fs::file_size(entry.path(), gone));
          ++num_segments;
        }
        return status.disk_bytes == bytes && status.num_segments == num_segments;
      });
    }
    scene.Close();
    const auto files = ReadSegments(scratch.path());
    most_files = std::max(most_files, files.size());
    const fs::path last = scratch.path() / files.rbegin()->first;
    const auto size = static_cast<std::int64_t>(files.rbegin()->second.size());
    const auto cut = static_cast<std::int64_t>(random.UniformInt(200));
    fs::resize_file(last, static_cast<std::uintmax_t>(std::max<std::int64_t>(0, size - cut)));
    states.clear();
    for (const auto& mark : scene.marks()) states.push_back(mark.state);
    if (scene.marks().size() == 1) states.push_back(scene.marks()[0].state);
  }
  EXPECT_GT(scene.table().first_sequence(), 300);
  // 100 rows are some 6 kB and a segment 3 kB; each start begins one more.
  EXPECT_LT(most_files, 20u);
}

TEST(JournalTest, AnotherSpecIsRefusedAndAnotherCapacityIsNot) {
  Written written;
  JournalOptions options = written.scene.options();
  const Recovered smaller = RecoverJournal(options, {.capacity = 30});
  EXPECT_EQ(smaller.table.total_inserted(), written.scene.table().total_inserted());
  EXPECT_EQ(smaller.table.num_rows(), 30);
  options.spec_hash ^= 1;
  EXPECT_THROW(RecoverJournal(options, written.scene.config()), base::Error);
  options = written.scene.options();
  options.shape = 3;
  EXPECT_THROW(RecoverJournal(options, written.scene.config()), base::Error);
}

TEST(JournalTest, OnlyOneMayHaveADirectory) {
  test::ScratchDirectory scratch;
  {
    JournalLock first(scratch.path());
    EXPECT_THROW(JournalLock second(scratch.path()), base::Error);
  }
  EXPECT_NO_THROW(JournalLock third(scratch.path()));
}

// A limit on the size of files stands in for a full disk: the kernel then writes a part, and then
// nothing.
TEST(JournalTest, AFullDiskHoldsBackWhatIsWrittenAndLosesNothing) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 1000, 1 << 20, 3);
  scene.Open();
  scene.Append(5);
  scene.WaitWritten();
  std::optional<test::SmallFiles> limit(4001);  // In the middle of some record.
  scene.Append(200);
  while (scene.journal().status().failures == 0) std::this_thread::yield();
  const std::uint64_t written = scene.journal().written();
  EXPECT_LT(written, scene.appended());
  EXPECT_THAT(scene.journal().status().failing, HasSubstr("cannot write"));
  EXPECT_GT(scene.journal().status().waiting_bytes, 0);
  // What is on disk now is a whole prefix and a torn record.
  EXPECT_EQ(fs::file_size(scratch.path() / "journal-00000001.log"), 4001u);

  limit.reset();
  scene.WaitWritten();
  EXPECT_THAT(scene.journal().status().failing, IsEmpty());
  EXPECT_EQ(scene.journal().status().waiting_bytes, 0);
  scene.Close();
  const Recovered recovered = RecoverJournal(scene.options(), scene.config());
  EXPECT_THAT(recovered.notes, IsEmpty());
  EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions),
            scene.marks().back().state);
}

// A file that cannot be made, and then one that cannot be written: the status tells the last fault.
TEST(JournalTest, TheStatusTellsTheLastFault) {
  test::ScratchDirectory scratch;
  const test::ScratchDirectory counts;
  JournalScene scene(scratch.path(), 1000, 1 << 20, 3);
  std::optional<test::SmallFiles> limit;
  {
    const test::FailingCalls failing(
        {.function = "open", .path = "*.log", .error = EMFILE, .last = 1'000'000},
        counts.path() / "opens");
    scene.Open();
    test::WaitUntil([&] {
      return scene.journal().status().failing.find("cannot create") != std::string::npos;
    });
    limit.emplace(20);
  }
  test::WaitUntil(
      [&] { return scene.journal().status().failing.find("cannot write") != std::string::npos; });
  limit.reset();
  scene.WaitWritten();
  EXPECT_THAT(scene.journal().status().failing, IsEmpty());
}

// Closing does not wait for a disk that stays full; what was written is whole.
TEST(JournalTest, ClosesOnAFullDisk) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 1000, 1 << 20, 3);
  scene.Open();
  std::optional<test::SmallFiles> limit(4001);
  scene.Append(200);
  scene.Close();
  limit.reset();
  std::string expected;
  for (const auto& mark : scene.marks()) {
    if (mark.end <= 4001) expected = mark.state;
  }
  const Recovered recovered = RecoverJournal(scene.options(), scene.config());
  EXPECT_EQ(JournalScene::Describe(recovered.table, recovered.sessions), expected);
}

// The system reports a lost page once, so that later syncs succeed says nothing.
TEST(JournalTest, OneFailedSyncEndsTheWritingUntilTheNextStart) {
  test::ScratchDirectory scratch;
  const test::ScratchDirectory counts;
  JournalScene scene(scratch.path(), 50, 2500, 11);
  scene.Open();
  scene.Append(100);
  scene.WaitWritten();
  {
    const test::FailingCalls failing(kFailingSyncs, counts.path() / "syncs");
    while (scene.journal().status().failing.empty()) std::this_thread::yield();
  }
  EXPECT_THAT(scene.journal().status().failing, HasSubstr("cannot sync"));
  EXPECT_EQ(scene.journal().status().failures, 1);
  const auto before = ReadSegments(scratch.path());
  const std::string state = scene.marks().back().state;
  // Enough for several segments, each of which would make one before it useless.
  scene.Append(100);
  scene.Close();
  EXPECT_EQ(ReadSegments(scratch.path()), before);

  // The next start proves by a copy what the syncs of the old file no longer can.
  const fs::path last = scratch.path() / before.rbegin()->first;
  const fs::path old = scratch.path() / "old";
  fs::create_hard_link(last, old);
  scene.Open();
  EXPECT_EQ(JournalScene::Describe(scene.table(), scene.sessions()), state);
  scene.WaitWritten();
  EXPECT_THAT(scene.journal().status().failing, IsEmpty());
  scene.Close();
  EXPECT_FALSE(fs::equivalent(last, old));
  EXPECT_EQ(base::ReadFile(last), base::ReadFile(old));
}

// Else a loss of power could leave what follows without what it follows on.
TEST(JournalTest, ASegmentBeginsOnlyWhenThoseBeforeItAreSynced) {
  test::ScratchDirectory scratch;
  const test::ScratchDirectory counts;
  JournalScene scene(scratch.path(), 1000, 2500, 11);
  scene.Open();
  // A segment without rows would be deleted once another follows it.
  scene.Append(10);
  scene.WaitWritten();
  ASSERT_EQ(scene.marks().back().segment, 0u);
  ASSERT_GT(scene.table().num_rows(), 0);
  {
    const test::FailingCalls failing(kFailingSyncs, counts.path() / "syncs");
    scene.Append(60);
    while (scene.journal().status().failing.empty()) std::this_thread::yield();
    std::uint64_t in_first = 0;
    for (const auto& mark : scene.marks()) in_first += mark.segment == 0;
    EXPECT_LE(scene.journal().written(), in_first);
    scene.Close();
    EXPECT_THAT(ReadSegments(scratch.path()), SizeIs(1));
    // The same of what a process before this one wrote.
    scene.Open();
    while (scene.journal().status().failing.empty()) std::this_thread::yield();
    EXPECT_EQ(scene.journal().written(), 0u);
    scene.Close();
    EXPECT_THAT(ReadSegments(scratch.path()), SizeIs(1));
  }
  scene.Open();
  scene.WaitWritten();
  scene.Close();
  EXPECT_THAT(ReadSegments(scratch.path()), SizeIs(2));
}

TEST(JournalTest, EachSegmentIsFullBeforeTheNextBegins) {
  Written written;
  const auto full = static_cast<std::size_t>(written.scene.options().segment_bytes);
  for (std::size_t i = 0; i < written.names.size(); ++i) {
    const std::size_t size = written.files[written.names[i]].size();
    if (i + 1 < written.names.size()) EXPECT_GE(size, full) << written.names[i];
    EXPECT_LT(size, 2 * full) << written.names[i];
  }
}

/// A journal without rows, whose syncs are as far apart as `sync_interval` says.
std::unique_ptr<Journal> MakeJournal(const fs::path& directory,
                                     std::chrono::milliseconds sync_interval) {
  return std::make_unique<Journal>(
      JournalOptions{.directory = directory, .sync_interval = sync_interval, .shape = 1},
      JournalLock(directory), std::vector<JournalSegment>(), 1, StateRecord{}, [] {});
}

TEST(JournalTest, OfTwoFilesSavedBesideUnderANameTheLastStays) {
  const test::ScratchDirectory scratch;
  const auto journal = MakeJournal(scratch.path(), std::chrono::hours(1));
  const fs::path cursors = CursorsPath(scratch.path());
  journal->SaveBeside(cursors, "first");
  journal->SaveBeside(PrioritiesPath(scratch.path()), "priorities");
  journal->SaveBeside(cursors, "second");
  journal->Close();
  EXPECT_EQ(base::ReadFile(cursors), "second");
  EXPECT_EQ(base::ReadFile(PrioritiesPath(scratch.path())), "priorities");
}

TEST(JournalTest, EverySyncIsCountedWithItsTime) {
  const test::ScratchDirectory scratch;
  const auto journal = MakeJournal(scratch.path(), std::chrono::milliseconds(0));
  Journal::Status before = journal->status();
  for (int i = 0; i < 20; ++i) {
    test::WaitUntil([&] { return journal->status().syncs > before.syncs; });
    const Journal::Status now = journal->status();
    EXPECT_GT(now.sync_s, before.sync_s);
    EXPECT_GT(now.synced, before.synced);
    before = now;
  }
}

// None of its rows is needed, also if the oldest needed one is the next.
TEST(JournalTest, ASegmentThatEndsAtTheOldestRowGoes) {
  const test::ScratchDirectory scratch;
  const auto journal = MakeJournal(scratch.path(), std::chrono::hours(1));
  for (int i = 0; i < 2; ++i) journal->BeginSegment(StateRecord{}, 0);
  journal->Close();
  EXPECT_THAT(ReadSegments(scratch.path()),
              testing::ElementsAre(testing::Key("journal-00000003.log")));
  EXPECT_EQ(journal->status().num_segments, 1);
  EXPECT_EQ(journal->status().disk_bytes,
            std::int64_t(fs::file_size(scratch.path() / "journal-00000003.log")));
}

// Else a server that runs for a week has no descriptor left.
TEST(JournalTest, SegmentsThatAreSyncedAreClosed) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 1000, 2500, 11);
  scene.Open();
  scene.Append(200);
  scene.WaitWritten();
  ASSERT_GT(ReadSegments(scratch.path()).size(), 5u);
  const auto num_open = [&] {
    int count = 0;
    std::error_code gone;
    for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
      const fs::path path = fs::read_symlink(entry.path(), gone);
      count += path.parent_path() == scratch.path() && path.extension() == ".log";
    }
    return count;
  };
  // The last one is written, and one may wait for its sync.
  while (num_open() > 2) std::this_thread::yield();
}

// The copy of the last segment waits for room, as every write does.
TEST(JournalTest, AThreadThatCannotBeStartedIsAnErrorAndTheNextStartWorks) {
  test::ScratchDirectory scratch;
  JournalScene scene{scratch.path(), 1000, 2500, 11};
  for (const int thread : {1, 2}) {
    const test::FailingCalls failing(
        {.function = "pthread_create", .path = "thread", .error = EAGAIN, .first = thread}, "none");
    EXPECT_THAT([&] { scene.Open(); },
                testing::ThrowsMessage<base::Error>(HasSubstr("cannot start a thread for")));
    EXPECT_EQ(failing.num_calls(), thread);
  }
  EXPECT_THAT(scene.Open(), IsEmpty());
}

TEST(JournalTest, StartsOnAFullDisk) {
  test::ScratchDirectory scratch;
  JournalScene scene(scratch.path(), 1000, 1 << 20, 3);
  scene.Open();
  scene.Append(200);
  scene.WaitWritten();
  const std::string state = scene.marks().back().state;
  scene.Close();
  std::optional<test::SmallFiles> limit(4001);
  scene.Open();
  while (scene.journal().status().failing.empty()) std::this_thread::yield();
  EXPECT_THAT(scene.journal().status().failing, HasSubstr("cannot write"));
  EXPECT_EQ(scene.journal().written(), 0u);
  limit.reset();
  scene.WaitWritten();
  scene.Close();
  scene.Open();
  EXPECT_EQ(JournalScene::Describe(scene.table(), scene.sessions()), state);
}

// Records that anybody may have written, with sound checksums: refused or followed, never more.
TEST(JournalTest, NoRecordTakesMoreThanItIsWorth) {
  base::Random random(9);
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::uint64_t> words(1 + random.UniformInt(30));
    for (auto& word : words) {
      word = random.Uniform() < 0.5 ? random.UniformInt(4) : random.NextU64();
    }
    const auto body = std::as_bytes(std::span(words));
    RecordBytes record{
        static_cast<std::uint32_t>(1 + random.UniformInt(5)), {body.begin(), body.end()}, {}};
    if (record.type == 4 && body.size() >= 32) {
      record.rows = body.subspan(32);
      record.head.resize(32);
    }
    const auto prefix = record.Prefix({1, 56});
    std::vector<std::uint64_t> aligned(record.size() / 8);
    const auto bytes = std::as_writable_bytes(std::span(aligned));
    std::copy(prefix.begin(), prefix.end(), bytes.begin());
    std::copy(body.begin(), body.end(), bytes.begin() + prefix.size());
    const ParsedRecord parsed = ParseRecord(bytes, {1, 56});
    ASSERT_NE(parsed.status, ParsedRecord::Status::kTorn);
    // The same bytes at another place are no record.
    ASSERT_EQ(ParseRecord(bytes, {1, 64}).status, ParsedRecord::Status::kDamaged);
    ASSERT_EQ(ParseRecord(bytes, {2, 56}).status, ParsedRecord::Status::kDamaged);
  }
}

}  // namespace
}  // namespace slalom::replay
