#pragma once

#include <initializer_list>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// What a role shows to Prometheus. `metrics/catalogue.h` lists every metric that exists, once;
/// docs/metrics.md is made from it.

namespace slalom::metrics {

enum class Type { kCounter, kGauge, kHistogram };

/// What a metric is, by Prometheus conventions: `slalom_` prefix, base units, `_total`.
struct Spec {
  std::string_view name;
  Type type = Type::kCounter;
  std::string_view help;
  std::vector<std::string_view> labels;  ///< Beside `role` and `name`, which all have.
  std::string_view roles;                ///< "actor, learner": who shows it; for the documentation.
  std::vector<double> buckets;           ///< Of a histogram: upper bounds.
};

/// Handles: valid as long as their registry. Thread-safe.
class Counter {
 public:
  void Increment(double by = 1.0);
  double value() const;

 private:
  friend class Registry;
  void* counter_ = nullptr;
};
class Gauge {
 public:
  void Set(double value);
  double value() const;

 private:
  friend class Registry;
  void* gauge_ = nullptr;
};
class Histogram {
 public:
  void Observe(double value);

 private:
  friend class Registry;
  void* histogram_ = nullptr;
};

/// The metrics of one role in one process. Thread-safe.
class Registry {
 public:
  /// `role` and `name` become labels of every metric. Process metrics (memory, descriptors, CPU
  /// time, start time) and build info are there from the start.
  Registry(std::string role, std::string name);
  ~Registry();

  /// The handle of a metric and these values of its labels, made at the first call (at 0, so that
  /// it shows at once). Keep it where calls are many. Requires: the spec's type, and as many
  /// values as it has labels.
  Counter counter(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Gauge gauge(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Histogram histogram(const Spec& spec, std::initializer_list<std::string_view> label_values = {});

  /// All of it in Prometheus' text format.
  std::string Text() const;

 private:
  friend class Exposer;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
