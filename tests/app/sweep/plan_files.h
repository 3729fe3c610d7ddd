#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "base/config.h"
#include "base/file.h"

/// Plans for tests.

namespace slalom::test {

/// A preset that trains for a moment on two courses.
inline constexpr char kTinyPreset[] =
    "[run]\nname = \"tiny\"\nmax_steps = 4000\nlearning_starts = 500\nupdates_per_step = 0.01\n"
    "[courses]\ntrain = \"generated:3:2\"\n"
    "[actor]\nnum_environments = 8\nwarmup_steps = 100\n"
    "[replay]\ncapacity = 4000\n"
    "[network]\nencoder_layers = []\nhead_layers = [8]\nsectors = 36\n"
    "[learner]\nbatch_size = 16\n";

inline constexpr char kTinyScore[] =
    "[[score]]\nname = \"test\"\ncourses = \"generated:4:2\"\nepisodes = 1\n";

/// Writes plan.toml with `text`, and the preset tiny.toml, into a directory.
inline std::filesystem::path WritePlan(const std::filesystem::path& directory,
                                       const std::string& text) {
  base::WriteFileAtomically(directory / "tiny.toml", kTinyPreset);
  base::WriteFileAtomically(directory / "plan.toml", text);
  return directory / "plan.toml";
}

inline constexpr char kSweep[] = "[sweep]\npreset = \"tiny.toml\"\nseeds = [1, 2]\n";

/// The cells of a plan with this text, on a platform that does not matter.
inline sweep::Cells Expand(const std::filesystem::path& directory, const std::string& text,
                           const std::vector<std::string>& overrides = {},
                           const train::Platform& platform = {.blas_kernel = "k",
                                                              .processor = "p"}) {
  return sweep::ExpandPlan(sweep::ReadPlan(WritePlan(directory, text), overrides), platform);
}

/// Makes the training of a cell one of fresh courses after the stages "first" of 1000 steps and
/// "second" of 2000.
inline void AddStages(sweep::Cell& cell) {
  cell.config->courses.train = "";
  cell.config->courses.fresh = "static";
  cell.config->distillation.stages = {{"first.run.max_steps", {"1000", ""}},
                                      {"second.run.max_steps", {"2000", ""}}};
  cell.config = train::ResolveRecorded(*cell.config);
}

}  // namespace slalom::test
