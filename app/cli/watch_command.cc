#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>

#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "app/watch/run_facts.h"
#include "app/watch/watch_drives.h"
#include "app/watch/watch_server.h"
#include "base/error.h"
#include "base/mutex.h"
#include "metrics/http_server.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

struct WatchOptions {
  std::string run;
  std::string bind = "127.0.0.1";
  int port = 7600;
};

/// Throws `base::Error` if there is nothing to watch.
void RequireRuns(const fs::path& root) {
  if (!fs::is_directory(root)) {
    const fs::path meant = fs::path("runs") / root;
    throw base::Error(fmt::format(
        "{}: {}, expected the directory of a run, or one that holds runs{}", root.string(),
        fs::exists(root) ? "is not a directory" : "there is no such directory",
        watch::IsRun(meant) ? fmt::format("; did you mean {}?", meant.string()) : ""));
  }
  if (watch::ListRuns(root).empty()) {
    throw base::Error(
        fmt::format("{}: holds no run, expected config.toml or metrics.csv in it or in a directory "
                    "in it; `slalom train` makes them",
                    root.string()));
  }
}

/// Returns once a stop is requested.
void WaitForStop(const std::stop_token& stop) {
  base::Mutex mutex;
  base::CondVar changed;
  bool stopped = false;
  const std::stop_callback wake(stop, [&] {
    const base::MutexLock lock(mutex);
    stopped = true;
    changed.NotifyAll();
  });
  const base::MutexLock lock(mutex);
  while (!stopped) changed.Wait(mutex);
}

void Watch(const WatchOptions& options) {
  const fs::path root = options.run;
  RequireRuns(root);
  const bool is_ipv6 = options.bind.find(':') != std::string::npos;
  const std::string host = is_ipv6 ? "[" + options.bind + "]" : options.bind;
  const metrics::Listener listener =
      metrics::Listen(fmt::format("{}:{}", host, options.port), "serve the page");
  StopSignals signals;
  watch::WatchDrives drives;
  const watch::WatchPages pages(
      root, {.facts = watch::FactsOf,
             .drives = [&drives](const fs::path& run) { return drives.Newest(run); }});
  const metrics::HttpServer server(
      listener.socket, [&pages](std::string_view path) -> metrics::HttpAnswer {
        try {
          return pages.Answer(path);
        } catch (const std::exception& error) {
          return {500, "Internal Server Error", "text/plain; charset=utf-8", error.what()};
        }
      });
  fmt::print("watching {} at http://{}:{}/ (Ctrl-C ends)\n", options.run, host, listener.port);
  std::fflush(stdout);
  WaitForStop(signals.token());
}

}  // namespace

void AddWatchCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("watch", "Show a training, running or finished, as a live page");
  auto options = std::make_shared<WatchOptions>();
  command->add_option("RUN", options->run, "Directory of a run, or one that holds runs")
      ->required();
  command
      ->add_option(
          "--bind", options->bind,
          "Address to serve at; anyone who reaches it can read the page, without a password")
      ->capture_default_str();
  command->add_option("--port", options->port, "Port to serve at; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->footer(
      "Prints the address of a page with curves, rates, time left and the newest policy's drives, "
      "which stays up to date\n"
      "until Ctrl-C. Reads the run's files and changes none. Examples:\n\n"
      "  slalom watch runs/quickstart\n"
      "  slalom watch runs --port 8080             all runs\n"
      "  ssh -L 7600:127.0.0.1:7600 HOST           to look from another machine, at "
      "http://127.0.0.1:7600/\n");
  command->callback([options] { Watch(*options); });
}

}  // namespace slalom::cli
