#include "app/sweep/cell_archive.h"

#include <fmt/format.h>
#include <lzma.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "app/sweep/claim.h"
#include "app/sweep/store.h"
#include "app/train/agent_run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "eval/report/result.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

constexpr std::size_t kMaxText = std::size_t{1} << 30;

const std::uint8_t* Bytes(std::string_view text) {
  return reinterpret_cast<const std::uint8_t*>(text.data());
}

std::uint8_t* Bytes(std::string& text) { return reinterpret_cast<std::uint8_t*>(text.data()); }

}  // namespace

std::string CompressXz(std::string_view text) {
  std::string bytes(lzma_stream_buffer_bound(text.size()), '\0');
  std::size_t size = 0;
  if (lzma_easy_buffer_encode(LZMA_PRESET_DEFAULT, LZMA_CHECK_CRC64, nullptr, Bytes(text),
                              text.size(), Bytes(bytes), &size, bytes.size()) != LZMA_OK) {
    throw std::bad_alloc();
  }
  bytes.resize(size);
  return bytes;
}

std::string DecompressXz(std::string_view bytes, const std::string& source) {
  std::string text(std::max<std::size_t>(16 * bytes.size(), 4096), '\0');
  while (true) {
    std::uint64_t memory = kMaxText;
    std::size_t read = 0, written = 0;
    const lzma_ret end = lzma_stream_buffer_decode(
        &memory, 0, nullptr, Bytes(bytes), &read, bytes.size(), Bytes(text), &written, text.size());
    if (end == LZMA_OK && read == bytes.size()) {
      text.resize(written);
      return text;
    }
    if (end != LZMA_BUF_ERROR || text.size() >= kMaxText) break;
    text.resize(std::min(4 * text.size(), kMaxText));
  }
  throw base::Error("{}: is damaged, expected a file of xz", source);
}

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxMetricsRows = 200;
constexpr std::string_view kArchiveFormat = "slalom-cells";
constexpr int kArchiveVersion = 2;

using OrderedJson = nlohmann::ordered_json;

/// The files of one cell, by their paths below its directory, in the order in which they are
/// written: the last ones make it count as done.
struct CellFiles {
  std::string id;
  std::string source;  // Where they were read from, for errors.
  std::vector<std::pair<fs::path, std::string>> files;

  void Add(const fs::path& path, std::string text) { files.emplace_back(path, std::move(text)); }
  /// The text of a file; null: there is none.
  const std::string* Find(const fs::path& path) const {
    for (const auto& [there, text] : files) {
      if (there == path) return &text;
    }
    return nullptr;
  }
  std::string PathOf(const fs::path& path) const { return source + "/" + path.string(); }
};

/// The text of a file that must hold a JSON object.
std::string ReadJson(const fs::path& file) {
  std::string text = base::ReadFile(file);
  if (OrderedJson::parse(text, nullptr, false).is_object()) return text;
  throw base::Error("{}: is damaged, expected a JSON object", file.string());
}

bool IsEvaluation(const fs::path& path) { return path.filename() == eval::kEvaluationFile; }

std::string ScoreFile(const std::string& digest) {
  return (fs::path("scores") / digest / eval::kEvaluationFile).string();
}

/// The changed keys of a config, without the path of the courses' collection.
template <class Config>
std::string Portable(Config config) {
  config.courses.collection = "";
  return config::Changes(std::move(config));
}

/// Training time and steps of each row of a training's log, as CSV.
std::string MetricsExcerpt(const fs::path& metrics) {
  const run::MetricsTable log = run::ParseMetrics(base::ReadFile(metrics), kMaxMetricsRows);
  const std::vector<double> steps = log.Column("steps");
  const std::vector<double> seconds = log.Column("training_s");
  std::string text = "training_s,steps\n";
  for (std::size_t i = 0; i < steps.size(); ++i) {
    text += fmt::format("{},{}\n", seconds[i], steps[i]);
  }
  return text;
}

/// A finished cell of a store.
CellFiles ReadFinished(const fs::path& store, const Cell& cell) {
  const CellDirectory directory(store, cell.id);
  CellFiles files{cell.id, directory.root().string(), {}};
  const auto add_if_there = [&](const fs::path& path) {
    const fs::path file = directory.root() / path;
    if (base::Exists(file)) files.Add(path, ReadJson(file));
  };
  add_if_there("cell.json");
  if (cell.config) files.Add("training.toml", Portable(*cell.config));
  bool has_snapshots = false;
  for (const ScoreTask& task : cell.scores) {
    const std::string source = directory.score_task(task).string();
    files.Add(fs::path("scores") / (task.digest + ".toml"),
              cell.config ? Portable(config::FromToml<train::RunConfig>(task.task, source))
                          : Portable(config::FromToml<train::AgentRunConfig>(task.task, source)));
    const std::string evaluation = ScoreFile(task.digest);
    files.Add(evaluation, eval::CompactResult(base::ReadFile(directory.root() / evaluation),
                                              files.PathOf(evaluation)));
    has_snapshots = has_snapshots || task.snapshot_steps > 0;
  }
  const fs::path metrics = run::RunDirectory{directory.run()}.metrics();
  if (has_snapshots && base::Exists(metrics)) files.Add("run/metrics.csv", MetricsExcerpt(metrics));
  add_if_there("scored.json");
  add_if_there("trained.json");
  return files;
}

/// The cells of an archive by their ids, as JSON.
using Archive = std::map<std::string, OrderedJson>;

bool IsJson(const fs::path& path) { return path.extension() == ".json"; }

OrderedJson ToJson(const CellFiles& cell) {
  OrderedJson json = OrderedJson::object();
  for (const auto& [path, text] : cell.files) {
    json[path.string()] = IsJson(path) ? OrderedJson::parse(text) : OrderedJson(text);
  }
  return json;
}

std::string PrintArchive(const Archive& archive) {
  std::string text =
      OrderedJson({{"format", kArchiveFormat}, {"version", kArchiveVersion}}).dump() + "\n";
  for (const auto& [id, files] : archive) {
    text += OrderedJson({{"id", id}, {"files", files}}).dump() + "\n";
  }
  return CompressXz(text);
}

Archive ReadArchive(const fs::path& file) {
  const std::string text = DecompressXz(base::ReadFile(file), file.string());
  const auto require = [&](bool condition, std::string_view what) {
    base::ThrowIf(!condition, "{}: {}", file.string(), what);
  };
  std::size_t begin = 0;
  const auto next = [&] {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const OrderedJson json =
        OrderedJson::parse(text.begin() + static_cast<std::ptrdiff_t>(begin),
                           text.begin() + static_cast<std::ptrdiff_t>(end), nullptr, false);
    begin = end + 1;
    return json.is_object() ? json : OrderedJson::object();
  };
  const OrderedJson head = next();
  require(head.value("format", OrderedJson()) == OrderedJson(kArchiveFormat),
          "is damaged, expected cells that `slalom sweep export` wrote");
  require(head.value("version", OrderedJson()) == OrderedJson(kArchiveVersion),
          fmt::format("has another version than {}, export it again", kArchiveVersion));
  Archive archive;
  while (begin < text.size()) {
    OrderedJson cell = next();
    const OrderedJson id = cell.value("id", OrderedJson());
    require(id.is_string() && cell.value("files", OrderedJson()).is_object(),
            fmt::format("is damaged at cell {}", archive.size() + 1));
    require(archive.emplace(id.get<std::string>(), std::move(cell["files"])).second,
            fmt::format("has the cell '{}' twice", id.get<std::string>()));
  }
  return archive;
}

/// Whether an archive may have a file of this path below a cell's directory.
bool IsArchived(const fs::path& path) {
  const std::string text = path.string();
  if (text.empty() || text.find("..") != std::string::npos || path.is_absolute()) return false;
  for (const char* name :
       {"cell.json", "training.toml", "scored.json", "trained.json", "run/metrics.csv"}) {
    if (text == name) return true;
  }
  const auto depth = std::distance(path.begin(), path.end());
  return *path.begin() == "scores" &&
         ((depth == 2 && path.extension() == ".toml") || (depth == 3 && IsEvaluation(path)));
}

/// A cell of an archive. Its configs are not read: they may be of an older program.
CellFiles ReadArchived(const fs::path& archive, const std::string& id, const OrderedJson& files) {
  CellFiles cell{id, (archive / id).string(), {}};
  const auto require = [&](bool condition, const std::string& what) {
    base::ThrowIf(!condition, "{}: {}", cell.source, what);
  };
  for (const auto& [name, value] : files.items()) {
    require(IsArchived(name), fmt::format("has a file '{}', which no cell has", name));
    require(IsJson(name) ? value.is_object() : value.is_string(),
            fmt::format("is damaged at '{}'", name));
    if (IsEvaluation(name)) {
      cell.Add(name, eval::CompactResult(value.dump(), cell.PathOf(name)));
    } else {
      cell.Add(name, IsJson(name) ? value.dump(2) + "\n" : value.get<std::string>());
    }
  }
  require(cell.Find("cell.json") != nullptr, "has no cell.json");
  require(cell.Find("training.toml") == nullptr || cell.Find("trained.json") != nullptr,
          "has a training without its trained.json");
  return cell;
}

/// The outcomes of an evaluation, apart from who made them and when.
std::string ResultsOf(std::string_view text, const std::string& source) {
  std::string results;
  for (const eval::ResultCourse& course : eval::ParseResult(text, source).result.courses) {
    results += course.name;
    for (const eval::ResultEpisode& episode : course.episodes) {
      results += fmt::format(" {} {} {}", env::ToString(episode.outcome), episode.time,
                             episode.num_collisions);
    }
    results += "\n";
  }
  return results;
}

/// Throws if another place has another result for one of the scores. `find` returns the text of a
/// file there, or null.
template <class Find>
void RequireSame(const CellFiles& cell, const std::string& other, Find find) {
  for (const auto& [path, text] : cell.files) {
    if (!IsEvaluation(path)) continue;
    const auto there = find(path);
    if (!there) continue;
    const std::string here = cell.PathOf(path);
    const std::string elsewhere = other + "/" + path.string();
    if (ResultsOf(text, here) == ResultsOf(*there, elsewhere)) continue;
    throw base::Error(
        "cell {}: {} and {} are results of the same cell and differ, expected the same; remove one "
        "of the two cells",
        cell.id, here, elsewhere);
  }
}

/// Writes the files that the directory does not have. Returns whether there were any.
bool Put(const CellFiles& cell, const fs::path& target) {
  bool is_new = false;
  for (const auto& [path, text] : cell.files) {
    if (base::Exists(target / path)) continue;
    base::MakeDirectories((target / path).parent_path());
    base::WriteFileAtomically(target / path, text);
    is_new = true;
  }
  return is_new;
}

}  // namespace

Copied ExportCells(const fs::path& store, const std::vector<Cell>& cells, const fs::path& archive) {
  Copied copied;
  Archive archived = base::Exists(archive) ? ReadArchive(archive) : Archive{};
  for (const Cell& cell : cells) {
    if (!IsDone(store, cell)) {
      ++copied.num_left;
      continue;
    }
    const CellFiles done = ReadFinished(store, cell);
    const auto there = archived.find(cell.id);
    CellFiles files = there == archived.end() ? CellFiles{cell.id, {}, {}}
                                              : ReadArchived(archive, cell.id, there->second);
    RequireSame(done, files.source, [&](const fs::path& path) { return files.Find(path); });
    const std::size_t num_before = files.files.size();
    for (const auto& [path, text] : done.files) {
      if (files.Find(path) == nullptr) files.Add(path, text);
    }
    if (files.files.size() == num_before) {
      ++copied.num_same;
    } else {
      ++copied.num_new;
      archived[cell.id] = ToJson(files);
    }
  }
  if (copied.num_new > 0) {
    base::MakeDirectories(fs::absolute(archive).parent_path());
    base::WriteFileAtomically(archive, PrintArchive(archived));
  }
  return copied;
}

Copied ImportCells(const fs::path& archive, const fs::path& store,
                   const std::optional<std::vector<Cell>>& cells) {
  Copied copied;
  std::vector<CellFiles> found;
  for (const auto& [id, files] : ReadArchive(archive)) {
    if (cells && std::ranges::find(*cells, id, &Cell::id) == cells->end()) {
      ++copied.num_left;
    } else {
      found.push_back(ReadArchived(archive, id, files));
    }
  }
  const fs::path directory = store / "cells";
  // One with its policy was trained here, perhaps on another class of machine.
  const auto is_own = [&](const CellFiles& cell) {
    return base::Exists(run::RunDirectory{directory / cell.id / "run"}.policy());
  };
  for (const CellFiles& cell : found) {
    if (is_own(cell)) continue;
    const fs::path target = directory / cell.id;
    RequireSame(cell, target.string(), [&](const fs::path& path) {
      return base::Exists(target / path) ? std::optional(base::ReadFile(target / path))
                                         : std::nullopt;
    });
  }
  for (const CellFiles& cell : found) {
    const fs::path target = directory / cell.id;
    if (is_own(cell)) {
      ++copied.num_same;
    } else if (IsClaimed(target)) {
      ++copied.num_busy;
    } else {
      ++(Put(cell, target) ? copied.num_new : copied.num_same);
    }
  }
  return copied;
}

}  // namespace slalom::sweep
