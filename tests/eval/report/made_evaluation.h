#pragma once

#include <map>
#include <string>
#include <vector>

#include "eval/evaluation.h"
#include "eval/report/report.h"

namespace slalom::testing {

/// An evaluation driven by a fake agent in `FakeEnvironment`s, five episodes on each of as many
/// courses as there are probabilities of success. The same every time.
eval::Evaluation MakeEvaluation(std::vector<double> success_probability,
                                const eval::EvaluationConfig& config = {},
                                const std::string& course_prefix = "course-");

/// An evaluation on courses with fixed and moving obstacles in the true simulator, by
/// `ReactiveAgent`, with scans on every course.
eval::Evaluation DriveCourses(int num_courses, const sim::EnvironmentConfig& environment = {});

/// The protocol "paper" in a result that was read.
std::map<std::string, std::string> PaperProtocol();

/// Of an agent of this name.
eval::Provenance MakeProvenance(const std::string& agent);

}  // namespace slalom::testing
