#pragma once

#include <chrono>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// The metrics that a role shows to Prometheus. metrics/catalogue.h lists every metric that exists,
/// and docs/metrics.md is made from it.

namespace prometheus {
class Counter;
class Gauge;
class Histogram;
}  // namespace prometheus

namespace slalom::metrics {

enum class Type { kCounter, kGauge, kHistogram };
std::string_view ToString(Type type);

/// Describes a metric. Names follow Prometheus' conventions: prefix `slalom_`, base units,
/// `_total`.
struct Spec {
  std::string_view name;
  Type type = Type::kCounter;
  std::string_view roles;  ///< The roles that show it, for the documentation: "actor, learner".
  std::string_view help;   ///< A sentence about its meaning and the values of its labels.
  std::vector<std::string_view>
      labels;                   ///< Besides `run`, `role` and `name`, which all metrics have.
  std::vector<double> buckets;  ///< Upper bounds of a histogram's buckets, ascending.
};

/// The handles `Counter`, `Gauge` and `Histogram` are values. They are valid as long as their
/// registry, and thread-safe. A default-constructed handle must be assigned to before it is used;
/// using it earlier ends the program.
class Counter {
 public:
  /// Requires: by >= 0.
  void Increment(double by = 1.0);
  /// Follows a total that is counted elsewhere, such as in a library or in a file that survives
  /// restarts: raises the value to `total` and never lowers it. Call it from one thread at a time.
  void RaiseTo(double total);
  double value() const;

 private:
  friend class Registry;
  prometheus::Counter* counter_ = nullptr;
};

class Gauge {
 public:
  /// NaN stands for "not known".
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

/// One series of a metric whose label values come and go. A value.
struct Sample {
  const Spec* spec = nullptr;
  std::vector<std::string> label_values;  ///< One for each of the spec's labels.
  double value = 0.0;
};

/// The process that the metrics describe. The first three become labels of every metric;
/// `slalom_build_info` and `slalom_blas_info` show the rest.
struct Identity {
  std::string role;         ///< "actor", "replay", "learner", "evaluator", "sweep".
  std::string name;         ///< Name of this process within its role; the same after a restart.
  std::string run = "run";  ///< `run.name` of its config, which tells services apart.
  std::string version = "unknown";  ///< Version of the program.
  std::string commit = "unknown";   ///< Commit of the program.
  std::string blas_kernel =
      "none";  ///< Kernel of the library that multiplies matrices; "none" if not used.
};

/// The metrics of one role in one process. Thread-safe.
class Registry {
 public:
  using Clock = std::chrono::steady_clock;

  /// Process metrics (memory, descriptors, CPU time, start time) and build info exist from the
  /// start. The process metrics are read whenever `Text` is called.
  explicit Registry(Identity identity);
  Registry(std::string role, std::string name);
  ~Registry();
  Registry(const Registry&) = delete;
  Registry& operator=(const Registry&) = delete;

  /// The handle of a metric with these values of its labels. The first call makes the metric, with
  /// value 0, so that it shows at once. When a role starts, take the handles of all label values
  /// that are known, since a rate needs the 0 before the first event. Keep the handles, because a
  /// call takes locks and searches.
  ///
  /// Requires: the spec has the type of the function, and there are as many values as labels. The
  /// values are UTF-8 and come from a short list, never from a peer's message.
  Counter counter(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Gauge gauge(const Spec& spec, std::initializer_list<std::string_view> label_values = {});
  Histogram histogram(const Spec& spec, std::initializer_list<std::string_view> label_values = {});

  /// Shows these series in place of the last call's. Meant for values read from files that appear
  /// and vanish: a series with a handle would stay for as long as the registry.
  ///
  /// Requires: no histograms; as many values as labels, in UTF-8; no two samples of one metric with
  /// the same values, and no metric of which a handle was taken.
  void Replace(const std::vector<Sample>& samples);

  /// All metrics in Prometheus' text format.
  std::string Text() const;

  /// Describes in words what is wrong with the role now, for `/healthy`. Empty if it is well.
  void SetFault(std::string fault);
  std::string fault() const;

  /// Notes that the role's main loop turns. A role that calls it once must call it at least once a
  /// minute.
  void Beat(Clock::time_point now = Clock::now());
  /// Describes in words that the last `Beat` was more than two minutes ago. Empty if it was not, or
  /// there was none.
  std::string standstill(Clock::time_point now = Clock::now()) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slalom::metrics
