#include "metrics/registry.h"

#include <fmt/format.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <array>
#include <map>
#include <optional>
#include <utility>

#include "base/check.h"
#include "base/mutex.h"
#include "metrics/catalogue.h"
#include "metrics/process.h"

namespace slalom::metrics {
namespace {

constexpr std::chrono::minutes kStandstill{2};

prometheus::Labels LabelsOf(const Spec& spec, std::initializer_list<std::string_view> values) {
  SLALOM_CHECK_EQ(spec.labels.size(), values.size());
  prometheus::Labels labels;
  auto name = spec.labels.begin();
  for (const std::string_view value : values) labels.emplace(*name++, value);
  return labels;
}

template <class Builder>
auto& FamilyOf(Builder builder, const Spec& spec, const prometheus::Labels& labels,
               prometheus::Registry& registry) {
  return builder.Name(std::string(spec.name))
      .Help(std::string(spec.help))
      .Labels(labels)
      .Register(registry);
}

}  // namespace

std::string_view ToString(Type type) {
  constexpr std::array<std::string_view, 3> kNames = {"counter", "gauge", "histogram"};
  return kNames.at(static_cast<std::size_t>(type));
}

void Counter::Increment(double by) {
  SLALOM_CHECK(counter_ != nullptr);
  SLALOM_CHECK_GE(by, 0.0);
  counter_->Increment(by);
}

void Counter::RaiseTo(double total) {
  if (const double by = total - value(); by > 0.0) counter_->Increment(by);
}

double Counter::value() const {
  SLALOM_CHECK(counter_ != nullptr);
  return counter_->Value();
}

void Gauge::Set(double value) {
  SLALOM_CHECK(gauge_ != nullptr);
  gauge_->Set(value);
}

double Gauge::value() const {
  SLALOM_CHECK(gauge_ != nullptr);
  return gauge_->Value();
}

void Histogram::Observe(double value) {
  SLALOM_CHECK(histogram_ != nullptr);
  histogram_->Observe(value);
}

struct Registry::Impl {
  prometheus::Labels labels;
  prometheus::Registry registry;

  base::Mutex samples_mutex;
  std::vector<prometheus::MetricFamily> samples GUARDED_BY(samples_mutex);

  base::Mutex fault_mutex;
  std::string fault GUARDED_BY(fault_mutex);
  std::optional<Clock::time_point> beat GUARDED_BY(fault_mutex);

  base::Mutex process_mutex;
  Gauge resident_bytes GUARDED_BY(process_mutex);
  Gauge virtual_bytes GUARDED_BY(process_mutex);
  Gauge threads GUARDED_BY(process_mutex);
  Gauge open_descriptors GUARDED_BY(process_mutex);
  Gauge max_descriptors GUARDED_BY(process_mutex);
  Gauge start_time GUARDED_BY(process_mutex);
  Counter cpu_seconds GUARDED_BY(process_mutex);

  void ReadProcess() EXCLUDES(process_mutex) {
    const ProcessFigures figures = ReadProcessFigures();
    const auto set = [](Gauge& gauge, const std::optional<double>& value) {
      if (value) gauge.Set(*value);
    };
    base::MutexLock lock(process_mutex);
    set(resident_bytes, figures.resident_bytes);
    set(virtual_bytes, figures.virtual_bytes);
    set(threads, figures.threads);
    set(open_descriptors, figures.open_descriptors);
    set(max_descriptors, figures.max_descriptors);
    set(start_time, figures.start_time);
    if (figures.cpu_seconds) cpu_seconds.RaiseTo(*figures.cpu_seconds);
  }
};

Registry::Registry(std::string role, std::string name)
    : Registry(Identity{.role = std::move(role), .name = std::move(name)}) {}

Registry::Registry(Identity identity) : impl_(new Impl) {
  impl_->labels = {{"run", identity.run}, {"role", identity.role}, {"name", identity.name}};
  gauge(kBuildInfo, {identity.version, identity.commit}).Set(1.0);
  gauge(kBlasInfo, {identity.blas_kernel}).Set(1.0);
  base::MutexLock lock(impl_->process_mutex);
  impl_->resident_bytes = gauge(kProcessResidentBytes);
  impl_->virtual_bytes = gauge(kProcessVirtualBytes);
  impl_->threads = gauge(kProcessThreads);
  impl_->open_descriptors = gauge(kProcessOpenDescriptors);
  impl_->max_descriptors = gauge(kProcessMaxDescriptors);
  impl_->start_time = gauge(kProcessStartTime);
  impl_->cpu_seconds = counter(kProcessCpuSeconds);
}

Registry::~Registry() = default;

Counter Registry::counter(const Spec& spec, std::initializer_list<std::string_view> label_values) {
  SLALOM_CHECK(spec.type == Type::kCounter);
  Counter handle;
  handle.counter_ = &FamilyOf(prometheus::BuildCounter(), spec, impl_->labels, impl_->registry)
                         .Add(LabelsOf(spec, label_values));
  return handle;
}

Gauge Registry::gauge(const Spec& spec, std::initializer_list<std::string_view> label_values) {
  SLALOM_CHECK(spec.type == Type::kGauge);
  Gauge handle;
  handle.gauge_ = &FamilyOf(prometheus::BuildGauge(), spec, impl_->labels, impl_->registry)
                       .Add(LabelsOf(spec, label_values));
  return handle;
}

Histogram Registry::histogram(const Spec& spec,
                              std::initializer_list<std::string_view> label_values) {
  SLALOM_CHECK(spec.type == Type::kHistogram);
  Histogram handle;
  handle.histogram_ = &FamilyOf(prometheus::BuildHistogram(), spec, impl_->labels, impl_->registry)
                           .Add(LabelsOf(spec, label_values), spec.buckets);
  return handle;
}

void Registry::Replace(const std::vector<Sample>& samples) {
  std::map<std::string_view, prometheus::MetricFamily> families;
  for (const Sample& sample : samples) {
    const Spec& spec = *sample.spec;
    SLALOM_CHECK(spec.type != Type::kHistogram);
    SLALOM_CHECK_EQ(spec.labels.size(), sample.label_values.size());
    prometheus::ClientMetric series;
    for (const auto& [name, value] : impl_->labels) series.label.push_back({name, value});
    for (std::size_t i = 0; i < spec.labels.size(); ++i) {
      series.label.push_back({std::string(spec.labels[i]), sample.label_values[i]});
    }
    series.counter.value = series.gauge.value = sample.value;
    prometheus::MetricFamily& family = families[spec.name];
    family.name = spec.name;
    family.help = spec.help;
    family.type = spec.type == Type::kCounter ? prometheus::MetricType::Counter
                                              : prometheus::MetricType::Gauge;
    family.metric.push_back(std::move(series));
  }
  std::vector<prometheus::MetricFamily> shown;
  shown.reserve(families.size());
  for (auto& [name, family] : families) shown.push_back(std::move(family));
  base::MutexLock lock(impl_->samples_mutex);
  impl_->samples = std::move(shown);
}

std::string Registry::Text() const {
  impl_->ReadProcess();
  std::vector<prometheus::MetricFamily> families = impl_->registry.Collect();
  {
    base::MutexLock lock(impl_->samples_mutex);
    families.insert(families.end(), impl_->samples.begin(), impl_->samples.end());
  }
  return prometheus::TextSerializer().Serialize(families);
}

void Registry::SetFault(std::string fault) {
  base::MutexLock lock(impl_->fault_mutex);
  impl_->fault = std::move(fault);
}

std::string Registry::fault() const {
  base::MutexLock lock(impl_->fault_mutex);
  return impl_->fault;
}

void Registry::Beat(Clock::time_point now) {
  base::MutexLock lock(impl_->fault_mutex);
  impl_->beat = now;
}

std::string Registry::standstill(Clock::time_point now) const {
  base::MutexLock lock(impl_->fault_mutex);
  const std::optional<Clock::time_point> beat = impl_->beat;
  if (!beat || now - *beat <= kStandstill) return "";
  return fmt::format("the main loop has stood still for {:.0f} s",
                     std::chrono::duration<double>(now - *beat).count());
}

}  // namespace slalom::metrics
