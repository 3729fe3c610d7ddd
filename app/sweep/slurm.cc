#include "app/sweep/slurm.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string_view>

#include "base/check.h"
#include "base/child_process.h"
#include "base/error.h"
#include "base/file.h"
#include "base/file_lock.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

// Slurm kills a task that it stops early 30 seconds after SIGTERM, any other at its time limit. The
// program gets SIGTERM this many seconds before the limit, to save itself.
constexpr int kSecondsToSave = 60;

/// An array that was submitted, as submitted.json has it.
struct Submitted {
  std::string job;                 ///< Empty while sbatch runs, and if this program ended then.
  std::vector<std::string> cells;  ///< By index of the task.
};

fs::path RecordFile(const fs::path& directory) { return directory / "submitted.json"; }

std::vector<Submitted> ReadRecord(const fs::path& directory) {
  const fs::path file = RecordFile(directory);
  if (!fs::exists(file)) return {};
  std::vector<Submitted> arrays;
  try {
    const auto json = nlohmann::json::parse(base::ReadFile(file));
    for (const auto& array : json.at("arrays")) {
      arrays.push_back({array.at("job"), array.at("cells")});
    }
  } catch (const nlohmann::json::exception&) {
    throw base::Error(
        "{} is damaged: expected the arrays that were submitted; once squeue shows no task of this "
        "sweep, delete the file",
        file.string());
  }
  return arrays;
}

void WriteRecord(const fs::path& directory, const std::vector<Submitted>& arrays) {
  if (arrays.empty()) {
    std::error_code ec;
    fs::remove(RecordFile(directory), ec);
    return;
  }
  nlohmann::json json = {{"arrays", nlohmann::json::array()}};
  for (const Submitted& array : arrays) {
    json["arrays"].push_back({{"job", array.job}, {"cells", array.cells}});
  }
  base::WriteFileAtomically(RecordFile(directory), json.dump(1) + "\n");
}

std::string JobName(const std::string& sweep) { return "slalom-" + sweep; }

std::string TaskName(const std::string& job, std::size_t index) {
  return fmt::format("{}_{}", job, index);
}

/// A text as one word of bash.
std::string Quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

/// Runs a command of Slurm and returns its output. Throws `base::Error` if it is not installed, or
/// if it fails: `fault`, then the command's own words.
std::string AskSlurm(const std::vector<std::string>& arguments, std::string_view fault) {
  const std::string& program = arguments.front();
  try {
    const base::ProgramResult result = base::RunProgram(arguments);
    if (result.exit_code == 0) return result.output;
    std::istringstream in(result.errors.empty() ? result.output : result.errors);
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) {
      if (!line.empty()) lines.push_back(line);
    }
    if (lines.empty()) lines.push_back(fmt::format("exit code {}", result.exit_code));
    throw base::Error("{}: {}", fault, fmt::join(lines, "; "));
  } catch (const base::ProgramMissing&) {
    throw base::Error(
        "{} is not installed here, expected a machine of a Slurm cluster (Debian's package "
        "slurm-client)",
        program);
  }
}

/// State of a task, as squeue or sacct prints it.
struct TaskState {
  std::string state;
  std::string reason;
  std::string script;  ///< Of the tasks in the queue.
};
using TaskStates = std::map<std::string, TaskState, std::less<>>;  // By "12_3".

/// The lines of a table whose columns are separated by '|': task, state and perhaps a reason and a
/// script.
TaskStates ReadTable(const std::string& table) {
  TaskStates states;
  std::istringstream in(table);
  for (std::string line; std::getline(in, line);) {
    std::istringstream columns(line);
    std::string task;
    TaskState state;
    std::getline(columns, task, '|');
    std::getline(columns, state.state, '|');
    std::getline(columns, state.reason, '|');
    std::getline(columns, state.script);
    if (state.reason == "None") state.reason.clear();
    if (!state.state.empty()) states[task] = state;
  }
  return states;
}

/// The tasks that wait or run. Another sweep of the same name may be among them.
TaskStates ReadQueue(const std::string& sweep) {
  return ReadTable(AskSlurm(
      {"squeue", "--noheader", "--array", "--name=" + JobName(sweep), "--format=%F_%K|%T|%r|%o"},
      "squeue cannot say what is queued"));
}

/// The script of the array. It holds all that a task needs, since Slurm keeps a copy of it and a
/// later submission replaces the file.
std::string Script(const SlurmSweep& sweep, const std::vector<std::string>& cells) {
  std::vector<std::string> words;
  words.reserve(sweep.command.size());
  for (const std::string& word : sweep.command) words.push_back(Quoted(word));
  return fmt::format(
      R"(#!/bin/bash
# Written by slalom sweep run --engine slurm. Task N of the array works on the N-th of these cells.
cells=({})

# The program saves when it gets SIGTERM, and ends with 143.
program=""
told=""
trap 'told=yes; [[ -z $program ]] || kill -TERM "$program" 2>/dev/null' TERM
{} --cell "${{cells[SLURM_ARRAY_TASK_ID]}}" &
program=$!
[[ -z $told ]] || kill -TERM "$program" 2>/dev/null
while kill -0 "$program" 2>/dev/null; do wait "$program"; done
wait "$program"
status=$?

# Only a task that meets its time limit still counts as running. One that Slurm preempts or requeues
# comes back without this, and one that was cancelled must not.
task=${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID
if ((status == 143)) && [[ $(squeue --noheader --jobs="$task" --format=%T) == RUNNING ]]; then
  scontrol requeue "$task"
fi
exit "$status"
)",
      fmt::join(cells, " "), fmt::join(words, " "));
}

std::vector<std::string> SbatchCommand(const SlurmSweep& sweep, std::size_t num_cells,
                                       const fs::path& script) {
  const SlurmSettings& settings = sweep.settings;
  std::vector<std::string> command = {
      "sbatch",
      "--parsable",
      "--job-name=" + JobName(sweep.name),
      fmt::format("--array=0-{}{}", num_cells - 1,
                  settings.at_once > 0 ? fmt::format("%{}", settings.at_once) : ""),
      "--requeue",
      "--open-mode=append",
      fmt::format("--signal=B:TERM@{}", kSecondsToSave),
      fmt::format("--time={}", static_cast<std::int64_t>(std::ceil(settings.hours * 60.0))),
      fmt::format("--mem={}M", settings.memory_mb),
      "--ntasks=1",
      "--cpus-per-task=1",
      "--chdir=" + fs::current_path().string(),
      "--output=" + (fs::absolute(sweep.directory) / "%A_%a.txt").string()};
  if (!settings.partition.empty()) command.push_back("--partition=" + settings.partition);
  if (!settings.account.empty()) command.push_back("--account=" + settings.account);
  command.insert(command.end(), settings.options.begin(), settings.options.end());
  command.push_back(script.string());
  return command;
}

/// Submits the array and returns its number.
std::string SubmitArray(const SlurmSweep& sweep, std::size_t num_cells, const fs::path& script) {
  const std::string answer =
      AskSlurm(SbatchCommand(sweep, num_cells, script),
               fmt::format("sbatch refused an array of {} cells", num_cells));
  // "12", or "12;cluster".
  std::string job = answer.substr(0, answer.find_first_of(";\n"));
  base::ThrowIf(
      job.empty() || job.find_first_not_of("0123456789") != std::string::npos,
      "sbatch answered '{}', expected the number of a job; squeue shows whether there is one",
      answer);
  return job;
}

/// Fills in sacct's states of tasks that have left the queue. Throws as `AskSlurm`.
void AddEnded(std::vector<SlurmTask>& tasks) {
  std::set<std::string> jobs;
  for (const SlurmTask& task : tasks) {
    if (task.state.empty()) jobs.insert(task.task.substr(0, task.task.find('_')));
  }
  if (jobs.empty()) return;
  const TaskStates states =
      ReadTable(AskSlurm({"sacct", "--noheader", "--parsable2", "--allocations",
                          fmt::format("--jobs={}", fmt::join(jobs, ",")), "--format=JobID,State"},
                         "sacct cannot say how tasks ended that have left the queue"));
  for (SlurmTask& task : tasks) {
    const auto state = states.find(task.task);
    if (task.state.empty() && state != states.end()) task.state = state->second.state;
  }
}

/// Gives the array without a number its number: that of the array in the queue that has this script
/// and is not known. Removes it if there is none: sbatch was not called, or all its tasks have
/// ended.
void FindLostArray(std::vector<Submitted>& arrays, const TaskStates& states,
                   const fs::path& script) {
  std::set<std::string> jobs;
  for (const auto& [task, state] : states) {
    if (state.script == script) jobs.insert(task.substr(0, task.find('_')));
  }
  for (const Submitted& array : arrays) jobs.erase(array.job);
  for (Submitted& array : arrays) {
    if (array.job.empty() && !jobs.empty()) array.job = *jobs.begin();
  }
  std::erase_if(arrays, [](const Submitted& array) { return array.job.empty(); });
}

}  // namespace

SlurmSubmission SubmitToSlurm(const SlurmSweep& sweep, std::span<const std::string> cells) {
  SLALOM_CHECK(!sweep.command.empty());
  base::MakeDirectories(sweep.directory);
  const base::FileLock lock = base::FileLock::OfFile(
      sweep.directory / "submit.lock", "the plan's cells are being submitted; wait for the end");
  const fs::path script = fs::absolute(sweep.directory / "job.sh");
  std::vector<Submitted> arrays = ReadRecord(sweep.directory);
  std::set<std::string> queued;
  if (!arrays.empty()) {
    const TaskStates states = ReadQueue(sweep.name);
    if (std::ranges::any_of(arrays, &std::string::empty, &Submitted::job)) {
      FindLostArray(arrays, states, script);
      WriteRecord(sweep.directory, arrays);
    }
    for (const Submitted& array : arrays) {
      for (std::size_t i = 0; i < array.cells.size(); ++i) {
        if (states.contains(TaskName(array.job, i))) queued.insert(array.cells[i]);
      }
    }
  }
  Submitted array;
  for (const std::string& cell : cells) {
    if (!queued.contains(cell)) array.cells.push_back(cell);
  }
  SlurmSubmission submission;
  submission.num_submitted = static_cast<int>(array.cells.size());
  submission.num_queued = static_cast<int>(cells.size() - array.cells.size());
  if (array.cells.empty()) return submission;

  base::WriteFileAtomically(script, Script(sweep, array.cells));
  std::vector<Submitted> with_this = arrays;
  with_this.push_back(std::move(array));
  WriteRecord(sweep.directory, with_this);
  try {
    with_this.back().job = SubmitArray(sweep, with_this.back().cells.size(), script);
  } catch (const base::Error&) {
    WriteRecord(sweep.directory, arrays);
    throw;
  }
  WriteRecord(sweep.directory, with_this);
  submission.job = with_this.back().job;
  return submission;
}

SlurmStatus ReadSlurmStatus(const fs::path& directory, const std::string& name) {
  SlurmStatus status;
  for (const Submitted& array : ReadRecord(directory)) {
    if (array.job.empty()) continue;  // The next submission looks for it.
    for (std::size_t i = 0; i < array.cells.size(); ++i) {
      const std::string& cell = array.cells[i];
      std::erase_if(status.tasks, [&](const SlurmTask& task) { return task.cell == cell; });
      const std::string task = TaskName(array.job, i);
      status.tasks.push_back({cell, task, "", "", directory / (task + ".txt")});
    }
  }
  if (status.tasks.empty()) return status;
  const auto ask = [&](const auto& question) {
    try {
      question();
    } catch (const base::Error& error) {
      status.notes.push_back(fmt::format("{}.", error.what()));
    }
  };
  ask([&] {
    const TaskStates states = ReadQueue(name);
    for (SlurmTask& task : status.tasks) {
      const auto state = states.find(task.task);
      if (state == states.end()) continue;
      task.state = state->second.state;
      task.reason = state->second.reason;
    }
  });
  ask([&] { AddEnded(status.tasks); });
  return status;
}

}  // namespace slalom::sweep
