#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "app/watch/run_progress.h"
#include "metrics/http_server.h"

namespace slalom::watch {

/// Drives of a run's newest policy as a picture.
struct Drives {
  std::string svg;   ///< Empty if there is none yet.
  std::string note;  ///< A description of the drives, or the reason why there are none.
  int number = 0;    ///< Goes up with every new picture.
};

/// Functions that give the pages the data that is not in metrics.csv. The server's thread calls
/// them; they must be quick and must not throw.
struct RunSources {
  std::function<RunFacts(const std::filesystem::path& run)> facts;
  std::function<Drives(const std::filesystem::path& run)> drives;
};

/// Answers the requests of the page that `slalom watch` shows:
///
/// - `/`: the page, everything in it;
/// - `/runs.json`: name, state, steps, success rate and age of each run;
/// - `/run/NAME.json`: one run with its curves; `/run/NAME.svg`: its newest drives;
/// - anything else, including a run that is gone: 404.
///
/// NAME is percent-encoded and only ever compared with the names of the runs below `root`, so no
/// path of the file system can be asked for. Stateless: a run that appears or goes is seen with the
/// next request.
class WatchPages {
 public:
  WatchPages(std::filesystem::path root, RunSources sources)
      : root_(std::move(root)), sources_(std::move(sources)) {}

  metrics::HttpAnswer Answer(std::string_view path) const;

 private:
  metrics::HttpAnswer AnswerRun(std::string_view name, bool wants_picture) const;

  const std::filesystem::path root_;
  const RunSources sources_;
};

}  // namespace slalom::watch
