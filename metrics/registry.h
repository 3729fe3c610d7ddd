#pragma once

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// What a role shows to Prometheus. `metrics/catalogue.h` lists every metric that exists, once;
/// docs/metrics.md is made from it.

namespace prometheus {
class Counter;
class Gauge;
class Histogram;
}  // namespace prometheus

namespace slalom::metrics {

enum class Type { kCounter, kGauge, kHistogram };
std::string_view ToString(Type type);

/// What a metric is, by Prometheus conventions: `slalom_` prefix, base units, `_total`.
struct Spec {
  std::string_view name;
  Type type = Type::kCounter;
  std::string_view roles;                ///< "actor, learner": who shows it; for the documentation.
  std::string_view help;                 ///< A sentence: what it is, with the values of its labels.
  std::vector<std::string_view> labels;  ///< Beside `run`, `role` and `name`, which all have.
  std::vector<double> buckets;           ///< Of a histogram: upper bounds, rising.
};

/// Handles: a value each, valid as long as their registry. Thread-safe. One made by its default
/// constructor is there to be assigned to; to use it before is a mistake that ends the program.
class Counter {
 public:
  /// Requires: by >= 0.
  void Increment(double by = 1.0);
  /// Follows a total that is counted elsewhere (in a file that survives restarts, in a library):
  /// raises the value to it; never lowers it. Of one thread at a time.
  void RaiseTo(double total);
  double value() const;

 private:
  friend class Registry;
  prometheus::Counter* counter_ = nullptr;
};

class Gauge {
 public:
  /// NaN: not known.
  void Set(double value);
  double value() const;

 private:
  friend class Registry;
  prometheus::Gauge* gauge_ = nullptr;
};

class Histogram {
 public:
  void Observe(double value);

 private:
  friend class Registry;
  prometheus::Histogram* histogram_ = nullptr;
};

/// Whose metrics they are. The first three become labels of every metric; the rest is what
/// `slalom_build_info` shows.
struct Identity {
  std::string role;         ///< "actor", "replay", "learner", "evaluator".
  std::string name;         ///< Of this process among those of its role; the same after a restart.
  std::string run = "run";  ///< `run.name` of its config: tells services side by side.
  std::string version = "unknown";   ///< Of the program.
  std::string commit = "unknown";    ///< Of the program.
  std::string blas_kernel = "none";  ///< Of the library that multiplies matrices; none: not used.
};

/// The metrics of one role in one process. Thread-safe.
class Registry {
 public:
  /// Process metrics (memory, descriptors, CPU time, start time) and build info are there from the
  /// start; the former are read anew whenever the metrics are.
  explicit Registry(Identity identity);
  Registry(std::string role, std::string name);
  ~Registry();
  Registry(const Registry&) = delete;
  Registry& operator=(const Registry&) = delete;

  /// The handle of a metric and these values of its labels, made at the first call (at 0, so that
  /// it shows at once). Take the handles of all label values that are known when a role starts: a
  /// rate needs the 0 before the first event. Keep them; a call takes locks and searches.
  /// Requires: the spec's type, as many values as it has labels, and values that are UTF-8 and come
  /// from a short list: never what a peer sent.
  Counter counter(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Gauge gauge(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Histogram histogram(const Spec& spec, std::initializer_list<std::string_view> label_values = {});

  /// All of it in Prometheus' text format.
  std::string Text() const;

  /// What is wrong with the role now, in words, of which `/healthy` tells; empty: nothing.
  void SetFault(std::string fault);
  std::string fault() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
