#include "app/sweep/cell_archive.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "app/sweep/store.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/app/sweep/fake_sweep.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

std::map<std::string, std::string> FilesBelow(const fs::path& directory) {
  std::map<std::string, std::string> files;
  if (!fs::exists(directory)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(directory)) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), directory).string()] = base::ReadFile(entry.path());
  }
  return files;
}

/// A store with a finished training, one without a score and a finished planner.
class ArchiveTest : public testing::Test {
 protected:
  ArchiveTest() : sweep_({"row"}, {"test"}) {
    for (const std::string row : {"a", "b"}) {
      const std::size_t cell = sweep_.AddTraining({row}, 1);
      sweep_.cells.cells[cell].config->courses.collection = "/home/someone/barn";
      sweep_.FinishTraining(cell);
    }
    sweep_.AddPlanner({"dwa"});
    sweep_.Evaluate(0, "test", {"SSC", "TSC"});
    sweep_.Evaluate(2, "test", {"SSS", "CSC"});
    for (const Cell& cell : sweep_.cells.cells) {
      const CellDirectory directory(sweep_.store(), cell.id);
      base::WriteFileAtomically(directory.facts(), fmt::format("{{\"id\": \"{}\"}}\n", cell.id));
      base::MakeDirectories(directory.run());
      base::WriteFileAtomically(directory.run() / "policy.safetensors", "weights");
    }
  }

  const Cell& cell(std::size_t index) const { return sweep_.cell(index); }
  Copied Export() { return ExportCells(sweep_.store(), sweep_.cells.cells, archive()); }
  Copied Import() const { return ImportCells(archive(), other()); }
  fs::path archive() const { return scratch_.path() / "archive"; }
  fs::path other() const { return scratch_.path() / "store"; }
  fs::path Archived(std::size_t index) const { return archive() / (cell(index).id + ".json"); }
  std::string Evaluation(const fs::path& cell) const {
    return (cell / "scores/test-0/evaluation.json").string();
  }

  test::FakeSweep sweep_;
  test::ScratchDirectory scratch_;
};

TEST_F(ArchiveTest, DoneCellsAreDoneInAnotherStoreWithTheSameResults) {
  const Copied exported = Export();
  EXPECT_EQ(exported.num_new, 2);
  EXPECT_EQ(exported.num_left, 1);
  for (const auto& [name, text] : FilesBelow(archive())) {
    EXPECT_THAT(name, Not(HasSubstr("policy")));
    EXPECT_THAT(text, AllOf(Not(HasSubstr("/home")), Not(HasSubstr(sweep_.store().string()))));
  }
  EXPECT_EQ(Import().num_new, 2);
  EXPECT_TRUE(IsDone(other(), cell(0)));
  EXPECT_FALSE(IsDone(other(), cell(1)));
  EXPECT_TRUE(IsDone(other(), cell(2)));
  EXPECT_EQ(ReadCellStatus(other(), cell(0)).trained->host, "node-1");
  const SweepResults here = sweep_.Results();
  const SweepResults there = CollectResults(sweep_.plan, sweep_.cells, other());
  const auto scores = [](const SweepResults& results, std::size_t row) {
    const eval::Agent agent = AgentOf(results, results.scores[0].rows.at(row));
    return eval::ScoresOf(agent, eval::Quantities().front()).scores;
  };
  for (const std::size_t row : {0, 2}) EXPECT_EQ(scores(there, row), scores(here, row));
  // The same once more, from here and from there.
  const auto files = FilesBelow(archive());
  EXPECT_EQ(Export().num_same, 2);
  EXPECT_EQ(Import().num_same, 2);
  EXPECT_EQ(FilesBelow(archive()), files);
  // From there without the policies: the same archive.
  const fs::path again = scratch_.path() / "again";
  EXPECT_EQ(ExportCells(other(), sweep_.cells.cells, again).num_new, 2);
  EXPECT_EQ(FilesBelow(again), files);
}

TEST_F(ArchiveTest, OnlyCellsOfThePlanAreTakenUpIfOneIsGiven) {
  Export();
  const Copied copied = ImportCells(archive(), other(), std::vector<Cell>{cell(2)});
  EXPECT_EQ(copied.num_new, 1);
  EXPECT_EQ(copied.num_left, 1);
  EXPECT_FALSE(IsDone(other(), cell(0)));
}

TEST_F(ArchiveTest, OtherResultsOfACellAreAnErrorThatNamesBothFiles) {
  Export();
  sweep_.Evaluate(2, "test", {"SSS", "CSS"});
  const auto names_both = ThrowsMessage<base::Error>(
      AllOf(HasSubstr("cell " + cell(2).id), HasSubstr(Evaluation(Archived(2))),
            HasSubstr(Evaluation(sweep_.store() / "cells" / cell(2).id))));
  EXPECT_EQ(ImportCells(archive(), sweep_.store()).num_same, 2) << "trained here, left alone";
  fs::remove(CellDirectory(sweep_.store(), cell(2).id).run() / "policy.safetensors");
  const auto files = FilesBelow(sweep_.store());
  EXPECT_THAT([&] { ImportCells(archive(), sweep_.store()); }, names_both);
  EXPECT_EQ(FilesBelow(sweep_.store()), files);
  EXPECT_THAT([&] { Export(); }, names_both);
}

TEST_F(ArchiveTest, AScoreIsAddedToACellThatIsThere) {
  Export();
  const std::string before = base::ReadFile(Archived(2));
  sweep_.AddSnapshot(2, 0);
  sweep_.cells.cells[2].scores.back().digest = "test-1";
  base::MakeDirectories(sweep_.store() / "cells" / cell(2).id / "scores/test-1");
  base::WriteFileAtomically(sweep_.store() / "cells" / cell(2).id / "scores/test-1/evaluation.json",
                            base::ReadFile(Evaluation(sweep_.store() / "cells" / cell(2).id)));
  EXPECT_EQ(Export().num_new, 1);
  EXPECT_THAT(base::ReadFile(Archived(2)), HasSubstr("\"scores/test-1/evaluation.json\": {"));
  EXPECT_GT(base::ReadFile(Archived(2)).size(), before.size());
}

TEST_F(ArchiveTest, ADamagedFileIsRefusedBeforeAnythingIsWritten) {
  Export();
  const auto refused = [&](std::size_t index, const std::string& from, const std::string& to,
                           const std::string& what) {
    const std::string text = base::ReadFile(Archived(index));
    std::string damaged = text;
    damaged.replace(damaged.find(from), from.size(), to);
    base::WriteFileAtomically(Archived(index), damaged);
    EXPECT_THAT([&] { Import(); },
                ThrowsMessage<base::Error>(AllOf(HasSubstr(Archived(index)), HasSubstr(what))));
    EXPECT_TRUE(FilesBelow(other()).empty());
    base::WriteFileAtomically(Archived(index), text);
  };
  refused(2, "\"files\"", "files", "is damaged");
  refused(2, "slalom-cell", "slalom-sell", "is damaged");
  refused(2, "\"version\": 1", "\"version\": 2", "another version");
  refused(2, "\"version\": 1", "\"version\": \"1\"", "another version");
  refused(2, "\"id\": \"", "\"id\": \"x", "is of the cell 'x");
  refused(2, "\"id\": \"", "\"id\": 1, \"name\": \"", "is of the cell '1'");
  refused(2, "\"slalom-cell\"", "7", "is damaged");
  refused(2, "\"cell.json\"", "\"\"", "has a file '', which no cell has");
  refused(2, "\"cell.json\"", "\"../cell.json\"", "'../cell.json', which no cell has");
  refused(2, "\"cell.json\"", "\"scored.json\"", "has no cell.json");
  refused(2, "slalom-evaluation", "slalom-evalution", "evaluation.json");
  refused(0, "\"trained.json\"", "\"scored.json\"", "without its trained.json");
  refused(0, "\"training.toml\": \"", "\"training.toml\": 1, \"a\": \"", "at 'training.toml'");
  EXPECT_THAT([&] { ImportCells("nowhere", other()); },
              ThrowsMessage<base::Error>(HasSubstr("nowhere: there is no such directory")));
}

TEST_F(ArchiveTest, ACellWithItsPolicyIsLeftAlone) {
  Export();
  fs::remove(CellDirectory(sweep_.store(), cell(0).id).facts());
  const auto files = FilesBelow(sweep_.store());
  EXPECT_EQ(ImportCells(archive(), sweep_.store()).num_same, 2);
  EXPECT_EQ(FilesBelow(sweep_.store()), files);
}

TEST_F(ArchiveTest, AnImportedTrainingLacksItsPolicy) {
  Export();
  Import();
  EXPECT_TRUE(LacksPolicy(other(), cell(0)));
  EXPECT_FALSE(LacksPolicy(sweep_.store(), cell(0)));
  EXPECT_FALSE(LacksPolicy(other(), cell(2))) << "a planner has none";
}

}  // namespace
}  // namespace slalom::sweep
