#include "app/train/course_teachers.h"

#include <algorithm>
#include <utility>

#include "policy/policy.h"

namespace slalom::train {

CourseTeachers::CourseTeachers(const ResolvedRun& run, const std::filesystem::path& directory)
    : mix_(run.courses.Mix()) {
  const policy::PolicySpec student = MakePolicySpec(run);
  for (const auto& [kind, file] : TeacherFiles(run, directory)) {
    const auto known = std::ranges::find(teachers_, file, &Teacher::file);
    of_kind_[kind] = static_cast<std::size_t>(known - teachers_.begin());
    if (known != teachers_.end()) continue;
    policy::PolicySnapshot snapshot = policy::LoadPolicy(file).snapshot;
    // What the student sees, and privileged fields if the teacher sees them.
    env::ObservationSpec seen = student.observation;
    seen.privileged |= snapshot.spec.observation.privileged;
    seen.state_size = env::StateSize(seen);
    policy::RequireSameInterface(file.string(), snapshot.spec, seen, student.actions);
    teachers_.push_back(
        {file,
         std::make_unique<policy::NetworkAgent>(policy::WithoutPlanning(std::move(snapshot))),
         {}});
  }
}

void CourseTeachers::Act(const env::ObservationBatch& observations, std::span<const int> courses,
                         std::span<float> actions) {
  for (Teacher& teacher : teachers_) {
    teacher.actions.resize(actions.size());
    teacher.agent->Act(observations, teacher.actions);
  }
  const std::size_t size = actions.size() / courses.size();
  for (std::size_t i = 0; i < courses.size(); ++i) {
    const Teacher& teacher = teachers_[of_kind_.at(sim::KindOf(mix_, courses[i]))];
    std::copy_n(teacher.actions.begin() + i * size, size, actions.begin() + i * size);
  }
}

std::unique_ptr<actor::Teachers> MakeTeachers(const ResolvedRun& run,
                                              const std::filesystem::path& directory) {
  if (!learner::TraitsOf(run.method.learner).is_taught) return nullptr;
  return std::make_unique<CourseTeachers>(run, directory);
}

}  // namespace slalom::train
