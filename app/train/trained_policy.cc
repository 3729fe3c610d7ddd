#include "app/train/trained_policy.h"

#include <charconv>
#include <string>

#include "policy/policy.h"

namespace slalom::train {
namespace {

template <class Number>
Number Figure(const nn::Metadata& metadata, const std::string& key) {
  Number number = 0;
  const auto found = metadata.find(key);
  if (found == metadata.end()) return number;
  std::from_chars(found->second.data(), found->second.data() + found->second.size(), number);
  return number;
}

}  // namespace

bool IsAtLimit(const PolicyFigures& figures, const run::RunSettings& limits) {
  constexpr double kRounding = 0.01;  // Of the time in a policy, [s].
  return figures.steps >= limits.max_steps ||
         (limits.max_seconds > 0.0 && figures.training_s >= limits.max_seconds - kRounding);
}

PolicyFigures FiguresOf(const nn::Metadata& metadata) {
  return {.steps = Figure<std::int64_t>(metadata, "steps"),
          .updates = Figure<std::int64_t>(metadata, "updates"),
          .training_s = Figure<double>(metadata, "training_s")};
}

PolicyFigures ReadPolicyFigures(const std::filesystem::path& policy) {
  return FiguresOf(policy::LoadPolicy(policy).metadata);
}

}  // namespace slalom::train
