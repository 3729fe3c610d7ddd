#include "app/train/run_identity.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "base/config.h"
#include "base/file.h"
#include "policy/nn/kernels/blas_kernel.h"
#include "policy/nn/kernels/cpu_features.h"

namespace slalom::train {
namespace {

/// Keys, and sections that end in a dot, which a resumed run may change.
constexpr std::array<std::string_view, 19> kFreeKeys = {"run.max_steps",
                                                        "run.max_seconds",
                                                        "run.log_interval",
                                                        "run.checkpoint_seconds",
                                                        "run.checkpoint_steps",
                                                        "run.snapshot_seconds",
                                                        "run.snapshot_steps",
                                                        "run.simulation_threads",
                                                        "run.keep_checkpoints",
                                                        "learner.threads",
                                                        "courses.test",
                                                        "evaluation.",
                                                        "guard.",
                                                        "service.",
                                                        "security.",
                                                        "replay_server.",
                                                        "learner_service.",
                                                        "actor_service.",
                                                        "evaluator_service."};

/// Keys, and sections that end in a dot, on which the processes of a service must agree.
constexpr std::array<std::string_view, 7> kSharedKeys = {
    "run.name", "run.seed", "task.", "courses.", "environment.", "network.", "learner.algorithm"};
/// Keys of these sections that are a process's own, like the path of its collection.
constexpr std::array<std::string_view, 2> kOwnKeys = {"courses.test", "courses.collection"};

constexpr std::size_t kMostShown = 200;  // A longer value is shown by its digest.

bool Matches(std::span<const std::string_view> names, std::string_view key) {
  return std::ranges::any_of(names, [key](std::string_view name) {
    return name.ends_with('.') ? key.starts_with(name) : key == name;
  });
}

std::string ProcessorClass() {
#if defined(__x86_64__)
  const nn::CpuFeatures cpu = nn::DetectCpuFeatures();
  if (cpu.avx512) return "x86-64-v4";
  return cpu.avx2_fma ? "x86-64-v3" : "x86-64-v2";
#elif defined(__aarch64__)
  return "aarch64";
#else
  return "other";
#endif
}

}  // namespace

Platform ThisPlatform() {
  const std::string kernel = nn::BlasKernel();
  return {.blas_kernel = kernel.empty() ? "none" : kernel, .processor = ProcessorClass()};
}

std::string Describe(const Platform& platform) {
  return fmt::format("numerics {}, BLAS kernel {}, processor {}", platform.numerics,
                     platform.blas_kernel, platform.processor);
}

bool DecidesRun(const RunConfig& config, std::string_view key) {
  // A single process reads this key of the server, too.
  if (key == "replay_server.priority_exponent") return config.method.learner.prioritized;
  return !Matches(kFreeKeys, key);
}

std::string RunDigest(const RunConfig& config) {
  const auto deciding = [&config](RunConfig& of) {
    config::FieldList list = config::ListFields(of);
    std::erase_if(list.fields, [&](const auto& field) { return !DecidesRun(config, field.key); });
    return list;
  };
  RunConfig copy = config;
  RunConfig defaults;
  return Digest(config::PrintChanges(deciding(copy), deciding(defaults)));
}

KeyDifference FindDifference(const RunConfig& first, const RunConfig& second) {
  RunConfig a = first;
  RunConfig b = second;
  const auto fields_a = config::ListFields(a).fields;
  const auto fields_b = config::ListFields(b).fields;
  for (std::size_t i = 0; i < fields_a.size(); ++i) {
    if (!DecidesRun(first, fields_a[i].key)) continue;
    std::string was = config::PrintValue(fields_a[i]);
    std::string is = config::PrintValue(fields_b[i]);
    if (was != is) return {fields_a[i].key, std::move(was), std::move(is)};
  }
  return {};
}

proto::RunIdentity ServiceIdentity(const RunConfig& config) {
  proto::RunIdentity identity;
  for (const auto& [key, value] : config::FlattenToml(config::Changes(config), "the config")) {
    if (!Matches(kSharedKeys, key) || Matches(kOwnKeys, key)) continue;
    const std::string& text = value.text;
    const bool is_plain = text.size() <= kMostShown &&
                          std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
    identity[key] = is_plain ? text : "a text with digest " + Digest(text);
  }
  return identity;
}

std::string Digest(std::string_view text) { return fmt::format("{:016x}", base::Checksum(text)); }

}  // namespace slalom::train
