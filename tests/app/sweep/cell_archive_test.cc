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
  fs::path Evaluation(const fs::path& cells, std::size_t index) const {
    return cells / cell(index).id / "scores" / "test-0" / "evaluation.json";
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
  const Quantity success{.key = "success_rate", .is_rate = true};
  for (const std::size_t row : {0, 2}) {
    EXPECT_EQ(RateTable(there.scores[0].rows.at(row), success).scores,
              RateTable(here.scores[0].rows.at(row), success).scores);
  }
  // The same once more, from here and from there.
  const auto files = FilesBelow(archive());
  EXPECT_EQ(Export().num_same, 2);
  EXPECT_EQ(Import().num_same, 2);
  EXPECT_EQ(FilesBelow(archive()), files);
  EXPECT_EQ(FilesBelow(other() / "cells"), files);
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
      AllOf(HasSubstr("cell " + cell(2).id), HasSubstr(Evaluation(archive(), 2).string()),
            HasSubstr(Evaluation(sweep_.store() / "cells", 2).string())));
  const auto files = FilesBelow(sweep_.store());
  EXPECT_THAT([&] { ImportCells(archive(), sweep_.store()); }, names_both);
  EXPECT_EQ(FilesBelow(sweep_.store()), files);
  EXPECT_THAT([&] { Export(); }, names_both);
}

TEST_F(ArchiveTest, ADamagedFileIsRefusedBeforeAnythingIsWritten) {
  Export();
  for (const fs::path& damaged :
       {Evaluation(archive(), 2), archive() / cell(2).id / "cell.json",
        archive() / cell(0).id / "trained.json", Evaluation(archive(), 0)}) {
    const std::string text = base::ReadFile(damaged);
    base::WriteFileAtomically(damaged, text.substr(0, text.size() / 2));
    EXPECT_THAT([&] { Import(); }, ThrowsMessage<base::Error>(HasSubstr(damaged.string())));
    EXPECT_TRUE(FilesBelow(other()).empty());
    base::WriteFileAtomically(damaged, text);
  }
  fs::remove(archive() / cell(0).id / "trained.json");
  EXPECT_THAT([&] { Import(); }, ThrowsMessage<base::Error>(HasSubstr("trained.json")));
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
