#include "cli/service_process.h"

#include <unistd.h>

#include <array>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "cli/version.h"
#include "config/config.h"
#include "metrics/catalogue.h"
#include "policy/blas.h"
#include "transport/security.h"

namespace slalom::cli {
namespace {

std::string HostName() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "host";
}

std::string ChooseName(transport::Role role, const train::ServiceConfig& config,
                       const ServiceOptions& options) {
  std::string name = options.name.value_or(config.name);
  if (name.empty()) {
    const bool is_many = role == transport::Role::kActor || role == transport::Role::kEvaluator;
    name = is_many ? HostName() : std::string(transport::ToString(role));
  }
  if (name.size() > 128 || name.find('/') != std::string::npos || name.starts_with('.')) {
    throw base::Error(fmt::format(
        "service.name is '{}', expected at most 128 characters, no '/' and no '.' in front", name));
  }
  return name;
}

}  // namespace

ServiceProcess::ServiceProcess(transport::Role role, const ServiceOptions& options)
    : role_(role),
      config_(config::Load<train::RunConfig>(options.config, options.overrides)),
      name_(ChooseName(role, config_.service, options)),
      context_(config_.service.io_threads),
      registry_(
          std::make_unique<metrics::Registry>(std::string(transport::ToString(role)), name_)) {
  registry_->gauge(metrics::kBuildInfo, {Version(), Commit()}).Set(1.0);
  registry_->gauge(metrics::kBlasInfo, {policy::BlasKernel()}).Set(1.0);
  spdlog::info("slalom {} {}, {} '{}'", Version(), transport::ToString(role),
               transport::ToString(role), name_);
  if (config_.service.metrics.empty()) return;
  exposer_ = std::make_unique<metrics::Exposer>(config_.service.metrics, *registry_);
  const auto host = config_.service.metrics.substr(0, config_.service.metrics.rfind(':'));
  spdlog::info("metrics at http://{}:{}/metrics", host, exposer_->port());
}

transport::ClientOptions ServiceProcess::replay() const {
  const std::string& endpoint = config_.service.replay;
  return {.endpoint = endpoint,
          .security = transport::MakeClientSecurity(config_.security, role_,
                                                    transport::Role::kReplay, endpoint)};
}

transport::ClientOptions ServiceProcess::learner() const {
  const std::string& endpoint = config_.service.learner;
  return {.endpoint = endpoint,
          .security = transport::MakeClientSecurity(config_.security, role_,
                                                    transport::Role::kLearner, endpoint)};
}

const std::string& BindAddress(const std::string& bind, const std::string& reached) {
  return bind.empty() ? reached : bind;
}

}  // namespace slalom::cli
