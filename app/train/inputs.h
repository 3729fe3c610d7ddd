#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/train/resolved_run.h"
#include "policy/policy.h"

/// A run keeps copies of the files that its config names, courses and policies, in a directory of
/// its own (`run::RunDirectory::inputs`). So it can go on wherever it lies, and whatever becomes of
/// those files. `CollectionConfig::inputs` is where a config reads copies.

namespace slalom::train {

/// The policy files that a run and its stages name: `learner.from`, and those of teachers.
std::vector<std::string> PolicyFilesOf(const ResolvedRun& run);

/// The file to read for a policy that a config names: the copy in `inputs` if there is one.
std::filesystem::path FindPolicy(const std::filesystem::path& inputs, const std::string& named);

/// The policy that the run starts from (`learner.from`), without what it plans with. Empty if it
/// starts from none. Throws `base::Error` that names the file if it cannot be read, or it has
/// another observation, actor, action or distribution than the run; the first difference is named.
std::optional<policy::PolicySnapshot> LoadFirstPolicy(const RunConfig& config);

/// Copies by the names of their files in `inputs`.
using Inputs = std::map<std::string, std::string>;

/// Reads the policies that the run names. Of what `run.courses.inputs` holds a copy, the copy is
/// read; a warning says if the file has another content by now. Throws `base::Error` if a file
/// cannot be read.
Inputs ReadPolicies(const ResolvedRun& run);

/// Reads all that the run names, likewise: policies, training courses and, if they can be read,
/// test courses. Courses of a generator need no copy.
Inputs ReadInputs(const ResolvedRun& run);

/// Writes them, as far as they are not there already. Throws `base::Error` if one cannot be
/// written.
void WriteInputs(const Inputs& copies, const std::filesystem::path& inputs);

/// The copies that the policy in this file was trained with: those of the run that it lies in.
/// Empty if it lies in no run.
std::filesystem::path InputsOf(const std::filesystem::path& policy);

}  // namespace slalom::train
