#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <vector>

#include "actor/teachers.h"
#include "app/train/resolved_run.h"
#include "policy/network_agent.h"
#include "sim/courses/course_stream.h"

namespace slalom::train {

/// Trained policies that teach by kind of course (`DistillationConfig`). Confined to one thread at
/// a time.
class CourseTeachers : public actor::Teachers {
 public:
  /// Loads the policies of the run in `directory`. Throws `base::Error` that names a policy's file
  /// if it cannot be read, or its observation or action is not that of the run, where a teacher may
  /// also see what no sensor tells (`ObservationSpec::privileged`).
  CourseTeachers(const ResolvedRun& run, const std::filesystem::path& directory);

  void Act(const env::ObservationBatch& observations, std::span<const int> courses,
           std::span<float> actions) override;

 private:
  struct Teacher {
    std::filesystem::path file;
    std::unique_ptr<policy::NetworkAgent> agent;
    std::vector<float> actions;  // [B, A]
  };

  const sim::FreshMix mix_;
  std::vector<Teacher> teachers_;                  // One for each file.
  std::map<sim::FreshKind, std::size_t> of_kind_;  // The teacher of each kind.
};

/// The teachers of a run, null if its algorithm has none. Throws as `CourseTeachers`.
std::unique_ptr<actor::Teachers> MakeTeachers(const ResolvedRun& run,
                                              const std::filesystem::path& directory);

}  // namespace slalom::train
