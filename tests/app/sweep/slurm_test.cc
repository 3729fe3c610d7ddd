#include "app/sweep/slurm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/file_lock.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// A directory whose programs stand in for Slurm's: each prints what the test wants, and keeps its
/// arguments.
class Slurm : public testing::Test {
 protected:
  void SetUp() override {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    root_ = fs::path(testing::TempDir()) / (std::string("slurm_") + info->name());
    fs::remove_all(root_);
    fs::create_directories(root_ / "bin");
    path_ = std::getenv("PATH");
    ::setenv("PATH", (root_ / "bin").c_str(), 1);
    sweep_ = {"sizes", {}, {"/opt/slalom", "sweep", "run", "it's.toml"}, root_ / "slurm"};
    Tool("squeue", "");
  }
  void TearDown() override {
    ::setenv("PATH", path_.c_str(), 1);
    fs::remove_all(root_);
  }

  /// Makes a program that prints and ends so. Bash has all that it needs built in.
  void Tool(const std::string& name, const std::string& output, int exit_code = 0,
            const std::string& errors = "") {
    const fs::path file = root_ / "bin" / name;
    std::ofstream(file) << "#!/bin/bash\nprintf '%s\\n' \"$@\" >'" << (root_ / name).string()
                        << "'\nprintf '%s' '" << output << "'\nprintf '%s' '" << errors
                        << "' >&2\nexit " << exit_code << "\n";
    fs::permissions(file, fs::perms::owner_all);
  }
  /// The arguments that it was last called with, one a line.
  std::string Arguments(const std::string& name) const { return Text(root_ / name); }
  static std::string Text(const fs::path& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::string ErrorOfSubmission() {
    try {
      SubmitToSlurm(sweep_, cells_);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "";
  }

  fs::path root_;
  std::string path_;
  SlurmSweep sweep_;
  std::vector<std::string> cells_ = {"aa", "bb", "cc"};
};

TEST_F(Slurm, OneArrayHoldsATaskForEachCell) {
  sweep_.settings = {.partition = "long",
                     .account = "robots",
                     .hours = 1.51,
                     .memory_mb = 2000,
                     .at_once = 2,
                     .options = {"--nice=10"}};
  Tool("sbatch", "12;cluster\n");
  const SlurmSubmission submission = SubmitToSlurm(sweep_, cells_);
  EXPECT_EQ(submission.job, "12");
  EXPECT_EQ(submission.num_submitted, 3);
  const std::string arguments = Arguments("sbatch");
  // 1.51 h are 90.6 minutes.
  for (const char* expected :
       {"--parsable\n", "--job-name=slalom-sizes\n", "--array=0-2%2\n", "--requeue\n",
        "--open-mode=append\n", "--signal=B:TERM@60\n", "--time=91\n", "--mem=2000M\n",
        "--cpus-per-task=1\n", "--partition=long\n", "--account=robots\n", "--nice=10\n"}) {
    EXPECT_THAT(arguments, HasSubstr(expected));
  }
  const std::string script = (sweep_.directory / "job.sh").string();
  EXPECT_TRUE(arguments.ends_with("--nice=10\n" + script + "\n")) << arguments;
}

TEST_F(Slurm, WithoutSettingsTheClusterDecides) {
  Tool("sbatch", "12\n");
  SubmitToSlurm(sweep_, cells_);
  const std::string arguments = Arguments("sbatch");
  EXPECT_THAT(arguments, HasSubstr("--array=0-2\n"));
  EXPECT_THAT(arguments, Not(HasSubstr("--partition")));
  EXPECT_THAT(arguments, Not(HasSubstr("--account")));
}

TEST_F(Slurm, CellsThatWaitOrRunAreNotSubmittedAgain) {
  Tool("sbatch", "12\n");
  SubmitToSlurm(sweep_, cells_);
  // Task 1 has left the queue; array 7 is of another directory.
  Tool("squeue", "12_0|RUNNING|None\n12_2|PENDING|Resources\n7_1|RUNNING|None\n");
  Tool("sbatch", "13\n");
  const SlurmSubmission second = SubmitToSlurm(sweep_, cells_);
  EXPECT_EQ(second.job, "13");
  EXPECT_EQ(second.num_submitted, 1);
  EXPECT_EQ(second.num_queued, 2);
  EXPECT_THAT(Text(sweep_.directory / "job.sh"), HasSubstr("cells=(bb)"));

  Tool("squeue", "12_0|RUNNING|None\n12_2|PENDING|Resources\n13_0|PENDING|None\n");
  fs::remove(root_ / "sbatch");
  const SlurmSubmission third = SubmitToSlurm(sweep_, cells_);
  EXPECT_EQ(third.job, "");
  EXPECT_EQ(third.num_queued, 3);
  EXPECT_FALSE(fs::exists(root_ / "sbatch")) << "sbatch was called";
}

TEST_F(Slurm, AnArrayWhoseNumberWasNotWrittenDownIsFound) {
  const fs::path record = sweep_.directory / "submitted.json";
  const fs::path meanwhile = root_ / "meanwhile";
  Tool("sbatch", "");
  const fs::path sbatch = root_ / "bin" / "sbatch";
  std::ofstream(sbatch) << "#!/bin/bash\nprintf '%s' \"$(<'" << record.string() << "')\" > '"
                        << meanwhile.string() << "'\nprintf '12\\n'\n";
  SubmitToSlurm(sweep_, cells_);
  // As after a kill of the program while sbatch ran.
  fs::rename(meanwhile, record);
  EXPECT_THAT(ReadSlurmStatus(sweep_.directory, sweep_.name).tasks, IsEmpty());
  const std::string script = fs::absolute(sweep_.directory / "job.sh").string();
  Tool("squeue", "12_0|RUNNING|None|" + script + "\n12_2|PENDING|Resources|" + script +
                     "\n7_1|RUNNING|None|/elsewhere/job.sh\n");
  Tool("sbatch", "13\n");
  const SlurmSubmission second = SubmitToSlurm(sweep_, cells_);
  EXPECT_EQ(second.num_queued, 2);
  EXPECT_EQ(second.num_submitted, 1);
  EXPECT_THAT(Text(record), AllOf(HasSubstr("\"12\""), HasSubstr("\"13\"")));
}

TEST_F(Slurm, AnArrayThatWasNeverSubmittedIsForgotten) {
  const fs::path record = sweep_.directory / "submitted.json";
  fs::create_directories(sweep_.directory);
  std::ofstream(record) << R"({"arrays": [{"job": "", "cells": ["aa", "bb", "cc"]}]})";
  Tool("sbatch", "13\n");
  EXPECT_EQ(SubmitToSlurm(sweep_, cells_).num_submitted, 3);
  EXPECT_THAT(Text(record), Not(HasSubstr("\"\"")));
}

TEST_F(Slurm, TwoDoNotSubmitAtOnce) {
  fs::create_directories(sweep_.directory);
  Tool("sbatch", "12\n");
  const auto lock = base::FileLock::OfFile(sweep_.directory / "submit.lock", "");
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("are being submitted"));
  EXPECT_FALSE(fs::exists(root_ / "sbatch")) << "sbatch was called";
}

TEST_F(Slurm, ErrorsNameThePackageOrPassOnWhatSlurmSays) {
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("sbatch is not installed"));
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("slurm-client"));
  Tool("sbatch", "", 1, "sbatch: error: invalid partition specified: nope\n");
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("invalid partition specified: nope"));
  Tool("sbatch", "hello\n");
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("expected the number of a job"));
  EXPECT_FALSE(fs::exists(sweep_.directory / "submitted.json"));

  Tool("sbatch", "12\n");
  SubmitToSlurm(sweep_, cells_);
  Tool("squeue", "", 1, "slurm_load_jobs error: Unable to contact slurm controller\n");
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("Unable to contact slurm controller"));
  std::ofstream(sweep_.directory / "submitted.json") << "{";
  EXPECT_THAT(ErrorOfSubmission(), HasSubstr("submitted.json is damaged"));
}

TEST_F(Slurm, StatusComesFromTheQueueAndTheDatabase) {
  EXPECT_THAT(ReadSlurmStatus(sweep_.directory, "sizes").tasks, IsEmpty());
  Tool("sbatch", "12\n");
  SubmitToSlurm(sweep_, cells_);
  Tool("squeue", "12_2|PENDING|Resources\n");
  Tool("sacct", "12_0|COMPLETED\n12_1|CANCELLED by 0\n12_2|PENDING\n");
  const SlurmStatus status = ReadSlurmStatus(sweep_.directory, "sizes");
  ASSERT_THAT(status.tasks, SizeIs(3));
  EXPECT_THAT(status.notes, IsEmpty());
  EXPECT_EQ(status.tasks[0].cell, "aa");
  EXPECT_EQ(status.tasks[0].task, "12_0");
  EXPECT_EQ(status.tasks[0].state, "COMPLETED");
  EXPECT_EQ(status.tasks[1].state, "CANCELLED by 0");
  EXPECT_EQ(status.tasks[2].state, "PENDING");
  EXPECT_EQ(status.tasks[2].reason, "Resources");
  EXPECT_EQ(status.tasks[2].output, sweep_.directory / "12_2.txt");
}

TEST_F(Slurm, StatusSaysWhatItCouldNotAsk) {
  Tool("sbatch", "12\n");
  SubmitToSlurm(sweep_, cells_);
  fs::remove(root_ / "bin/squeue");
  Tool("sacct", "", 1, "Slurm accounting storage is disabled\n");
  const SlurmStatus status = ReadSlurmStatus(sweep_.directory, "sizes");
  ASSERT_THAT(status.notes, SizeIs(2));
  EXPECT_THAT(status.notes[0], HasSubstr("squeue is not installed"));
  EXPECT_THAT(status.notes[1], HasSubstr("accounting storage is disabled"));
  ASSERT_THAT(status.tasks, SizeIs(3));
  EXPECT_EQ(status.tasks[0].state, "");
}

/// What job.sh does with a program that ends with `exit_code`, and with a queue in which the task
/// has this state. Returns its exit code.
class SlurmScript : public Slurm {
 protected:
  int Run(int exit_code, const std::string& state) {
    Tool("sbatch", "12\n");
    Tool("slalom", "", exit_code);
    Tool("scontrol", "");
    sweep_.command = {(root_ / "bin/slalom").string(), "it's.toml"};
    SubmitToSlurm(sweep_, cells_);
    Tool("squeue", state + "\n");
    const std::string command = "SLURM_ARRAY_JOB_ID=12 SLURM_ARRAY_TASK_ID=1 /bin/bash '" +
                                (sweep_.directory / "job.sh").string() + "'";
    const int status = std::system(command.c_str());
    return WEXITSTATUS(status);
  }
};

TEST_F(SlurmScript, ATaskWorksOnItsOwnCell) {
  EXPECT_EQ(Run(0, "RUNNING"), 0);
  EXPECT_EQ(Arguments("slalom"), "it's.toml\n--cell\nbb\n");
  EXPECT_EQ(Arguments("scontrol"), "");
}

TEST_F(SlurmScript, ATaskThatMetItsTimeLimitIsQueuedAgain) {
  EXPECT_EQ(Run(143, "RUNNING"), 143);
  EXPECT_EQ(Arguments("scontrol"), "requeue\n12_1\n");
}

TEST_F(SlurmScript, ACancelledOrFailedTaskIsNotQueuedAgain) {
  EXPECT_EQ(Run(143, "COMPLETING"), 143);
  EXPECT_EQ(Arguments("scontrol"), "");
  EXPECT_EQ(Run(1, "RUNNING"), 1);
  EXPECT_EQ(Arguments("scontrol"), "");
}

}  // namespace
}  // namespace slalom::sweep
