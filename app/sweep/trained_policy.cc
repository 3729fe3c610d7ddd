#include "app/sweep/trained_policy.h"

#include <charconv>
#include <string>

#include "policy/policy.h"

namespace slalom::sweep {
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

PolicyFigures ReadPolicyFigures(const std::filesystem::path& policy) {
  const nn::Metadata metadata = policy::LoadPolicy(policy).metadata;
  return {.steps = Figure<std::int64_t>(metadata, "steps"),
          .updates = Figure<std::int64_t>(metadata, "updates"),
          .training_s = Figure<double>(metadata, "training_s")};
}

}  // namespace slalom::sweep
