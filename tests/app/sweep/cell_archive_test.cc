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
  fs::path archive() const { return scratch_.path() / "archive/cells.jsonl.xz"; }
  fs::path other() const { return scratch_.path() / "store"; }
  fs::path Archived(std::size_t index) const { return archive() / cell(index).id; }
  std::string Text() const { return DecompressXz(base::ReadFile(archive()), "archive"); }
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
  EXPECT_THAT(Text(), AllOf(Not(HasSubstr("/home")), Not(HasSubstr(sweep_.store().string())),
                            Not(HasSubstr("policy.safetensors\":"))));
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
  const std::string bytes = base::ReadFile(archive());
  EXPECT_EQ(Export().num_same, 2);
  EXPECT_EQ(Import().num_same, 2);
  EXPECT_EQ(base::ReadFile(archive()), bytes);
  // From there without the policies: the same archive.
  const fs::path again = scratch_.path() / "again.xz";
  EXPECT_EQ(ExportCells(other(), sweep_.cells.cells, again).num_new, 2);
  EXPECT_EQ(base::ReadFile(again), bytes);
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
  const std::string before = Text();
  sweep_.AddSnapshot(2, 0);
  sweep_.cells.cells[2].scores.back().digest = "test-1";
  base::MakeDirectories(sweep_.store() / "cells" / cell(2).id / "scores/test-1");
  base::WriteFileAtomically(sweep_.store() / "cells" / cell(2).id / "scores/test-1/evaluation.json",
                            base::ReadFile(Evaluation(sweep_.store() / "cells" / cell(2).id)));
  EXPECT_EQ(Export().num_new, 1);
  EXPECT_THAT(Text(), HasSubstr("\"scores/test-1/evaluation.json\":{"));
  EXPECT_GT(Text().size(), before.size());
}

TEST_F(ArchiveTest, ADamagedFileIsRefusedBeforeAnythingIsWritten) {
  Export();
  const std::string text = Text();
  const auto refuses = [&](const std::string& bytes, const std::string& what) {
    base::WriteFileAtomically(archive(), bytes);
    EXPECT_THAT([&] { Import(); },
                ThrowsMessage<base::Error>(AllOf(HasSubstr(archive().string()), HasSubstr(what))));
    EXPECT_TRUE(FilesBelow(other()).empty());
  };
  const auto refused = [&](const std::string& after, const std::string& from, const std::string& to,
                           const std::string& what) {
    std::string damaged = text;
    damaged.replace(damaged.find(from, damaged.find(after)), from.size(), to);
    refuses(CompressXz(damaged), what);
  };
  const std::string training = cell(0).id, planner = cell(2).id;
  refused("", "slalom-cells", "slalom-sells", "is damaged, expected cells");
  refused("", "\"slalom-cells\"", "7", "is damaged, expected cells");
  refused("", "{", "[", "is damaged, expected cells");
  refused("", "\"version\":2", "\"version\":3", "another version");
  refused("", "\"version\":2", "\"version\":\"2\"", "another version");
  refused("\n", "\"files\"", "files", "is damaged at cell 1");
  refused("\n", "\"id\":\"", "\"id\":1,\"name\":\"", "is damaged at cell 1");
  refused(planner, "\"cell.json\"", "\"\"", "has a file '', which no cell has");
  refused(planner, "\"cell.json\"", "\"../cell.json\"", "'../cell.json', which no cell has");
  refused(planner, "\"cell.json\"", "\"scored.json\"", "has no cell.json");
  refused(planner, "slalom-evaluation", "slalom-evalution", "evaluation.json");
  refused(training, "\"trained.json\"", "\"scored.json\"", "without its trained.json");
  refused(training, "\"training.toml\":\"", "\"training.toml\":1,\"a\":\"", "at 'training.toml'");
  refuses(CompressXz(text + text.substr(text.rfind('\n', text.size() - 2) + 1)), "twice");
  const std::string bytes = CompressXz(text);
  refuses("", "expected a file of xz");
  refuses("cells", "expected a file of xz");
  refuses(bytes.substr(0, bytes.size() - 1), "expected a file of xz");
  refuses(bytes + "x", "expected a file of xz");
  refuses(bytes.substr(0, 60) + static_cast<char>(bytes[60] ^ 1) + bytes.substr(61),
          "expected a file of xz");
  EXPECT_THAT([&] { ImportCells("nowhere", other()); },
              ThrowsMessage<base::Error>(HasSubstr("nowhere")));
}

TEST(Xz, GivesBackWhatItWasGiven) {
  for (const std::string& text :
       {std::string(), std::string("slalom"), std::string(1 << 20, 'x')}) {
    EXPECT_EQ(DecompressXz(CompressXz(text), "text"), text);
  }
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
