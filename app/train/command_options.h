#pragma once

namespace slalom::train {

/// Options of `slalom train` and `slalom evaluate` that a sweep passes to them.
inline constexpr char kAgentOption[] = "--agent";
inline constexpr char kConfigOption[] = "--config";
inline constexpr char kCoursesOption[] = "--courses";
inline constexpr char kForceOption[] = "--force";
inline constexpr char kNameOption[] = "--name";
inline constexpr char kNoEvaluationOption[] = "--no-evaluation";
inline constexpr char kOutputOption[] = "--output";
inline constexpr char kPhysicsOption[] = "--physics";
inline constexpr char kPolicyOption[] = "--policy";
inline constexpr char kResumeOption[] = "--resume";
inline constexpr char kThreadsOption[] = "--threads";
inline constexpr int kMaxThreads = 256;  ///< The largest value of `kThreadsOption`.

}  // namespace slalom::train
