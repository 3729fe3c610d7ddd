#include "app/watch/watch_server.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <utility>

#include "app/watch/run_page.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using metrics::HttpAnswer;

/// Replaces bytes of a directory's name that are not UTF-8.
HttpAnswer JsonAnswer(const Json& json) {
  return {200, "OK", "application/json", json.dump(-1, ' ', false, Json::error_handler_t::replace)};
}

HttpAnswer NotFound(std::string body) {
  return {404, "Not Found", "text/plain; charset=utf-8", std::move(body)};
}

std::string Decode(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned value = 0;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(&text[i + 1], &text[i + 1] + 2, value, 16).ptr == &text[i + 1] + 2) {
      decoded += static_cast<char>(value);
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

}  // namespace

HttpAnswer WatchPages::Answer(std::string_view path) const {
  if (path == "/") return {200, "OK", "text/html; charset=utf-8", LivePage()};
  if (path == "/runs.json") {
    Json runs = Json::array();
    for (const fs::path& directory : ListRuns(root_)) {
      if (const auto run = ReadRun(directory, sources_.facts(directory), 2)) {
        runs.push_back(SummaryJson(*run));
      }
    }
    return JsonAnswer({{"runs", std::move(runs)}});
  }
  constexpr std::string_view kRun = "/run/";
  for (const std::string_view ending : {".json", ".svg"}) {
    if (!path.starts_with(kRun) || !path.ends_with(ending)) continue;
    path.remove_prefix(kRun.size());
    path.remove_suffix(std::min(path.size(), ending.size()));
    return AnswerRun(path, ending == ".svg");
  }
  return NotFound("here are /, /runs.json, /run/NAME.json and /run/NAME.svg\n");
}

HttpAnswer WatchPages::AnswerRun(std::string_view name, bool wants_picture) const {
  const std::string wanted = Decode(name);
  for (const fs::path& directory : ListRuns(root_)) {
    if (NameOf(directory) != wanted) continue;
    const Drives drives = sources_.drives(directory);
    if (wants_picture) {
      if (drives.svg.empty()) return NotFound(drives.note + "\n");
      return {200, "OK", "image/svg+xml", drives.svg};
    }
    const RunFacts facts = sources_.facts(directory);
    const auto run = ReadRun(directory, facts, kMaxPoints);
    if (!run) break;
    Json json = RunJson(*run, facts);
    json["drives"] = {{"number", drives.svg.empty() ? 0 : drives.number}, {"note", drives.note}};
    return JsonAnswer(json);
  }
  return NotFound("there is no such run\n");
}

}  // namespace slalom::watch
