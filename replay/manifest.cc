#include "replay/manifest.h"

#include <fmt/format.h>

#include <sstream>

#include "base/error.h"
#include "base/file.h"

namespace slalom::replay {
namespace {

constexpr std::string_view kTitle = "slalom-replay 1\n";

[[noreturn]] void Fail(std::string_view source, std::string_view why) {
  throw base::Error("{}: {}; the checkpoint is damaged", source, why);
}

template <class T>
T Number(std::istream& in, std::string_view source, std::string_view key, T min, T max) {
  std::string found_key;
  T value{};
  if (!(in >> found_key >> value) || found_key != key || value < min || value > max) {
    Fail(source, fmt::format("expected '{}' and a number from {} to {}", key, min, max));
  }
  return value;
}

/// As `Number`, but returns `otherwise` and reads nothing if another key follows.
int NumberIfThere(std::istream& in, std::string_view source, std::string_view key, int otherwise,
                  int max) {
  const auto here = in.tellg();
  std::string found_key;
  in >> found_key;
  in.seekg(here);
  return found_key == key ? Number(in, source, key, 1, max) : otherwise;
}

}  // namespace

std::string PrintManifest(const Manifest& manifest) {
  const env::StepShape& shape = manifest.shape;
  std::string text(kTitle);
  text += fmt::format("beams {}\n", shape.num_beams);
  // Manifests of courses, which were there first, do without.
  if (shape.state_size != env::kStateSize) text += fmt::format("state {}\n", shape.state_size);
  if (shape.action_size != env::kActionSize) text += fmt::format("action {}\n", shape.action_size);
  text += fmt::format("capacity {}\nbegin {}\nend {}\nstreams {}\n", manifest.capacity,
                      manifest.begin, manifest.end, manifest.open.size());
  if (!manifest.open.empty()) {
    for (const std::uint8_t open : manifest.open) text += open ? '1' : '0';
    text += '\n';
  }
  text += fmt::format("segments {}\n", manifest.part_files.size());
  for (const Storage::PartFile& part : manifest.part_files) {
    text += fmt::format("{} {} {} {:016x}\n", part.name, part.begin, part.end, part.digest);
  }
  return text + fmt::format("checksum {:016x}\n", base::Checksum(text));
}

Manifest ParseManifest(std::string_view text, std::string_view source) {
  if (!text.starts_with(kTitle)) Fail(source, "expected it to begin with 'slalom-replay 1'");
  const auto last_line = text.rfind("checksum ");
  if (last_line == std::string_view::npos ||
      text.substr(last_line) !=
          fmt::format("checksum {:016x}\n", base::Checksum(text.substr(0, last_line)))) {
    Fail(source, "its checksum does not match");
  }
  std::istringstream in(std::string(text.substr(kTitle.size())));
  constexpr std::int64_t kMaxRows = std::int64_t{1} << 60;
  Manifest manifest;
  manifest.shape.num_beams = Number(in, source, "beams", 0, 65536);
  manifest.shape.state_size =
      NumberIfThere(in, source, "state", env::kStateSize, env::kMaxStateSize);
  manifest.shape.action_size =
      NumberIfThere(in, source, "action", env::kActionSize, env::kMaxActionSize);
  manifest.capacity = Number<std::int64_t>(in, source, "capacity", 2, 1000000000);
  manifest.begin = Number<std::int64_t>(in, source, "begin", 0, kMaxRows);
  manifest.end =
      Number<std::int64_t>(in, source, "end", manifest.begin, manifest.begin + manifest.capacity);
  const auto streams = Number<std::int64_t>(in, source, "streams", 0, 1 << 24);
  if (streams > 0) {
    std::string bits;
    in >> bits;
    if (static_cast<std::int64_t>(bits.size()) != streams)
      Fail(source, "expected a digit per stream");
    for (const char bit : bits) manifest.open.push_back(bit == '1');
  }
  const auto num_part_files = Number<std::int64_t>(in, source, "segments", 0, 1 << 24);
  for (std::int64_t i = 0; i < num_part_files; ++i) {
    Storage::PartFile part;
    const bool is_read = static_cast<bool>(in >> part.name >> part.begin >> part.end >> std::hex >>
                                           part.digest >> std::dec);
    if (!is_read || part.begin >= part.end || part.name.find('/') != std::string::npos ||
        (i > 0 && part.begin != manifest.part_files.back().end)) {
      Fail(source, "expected the files under 'segments' to follow each other without a gap");
    }
    manifest.part_files.push_back(part);
  }
  const bool is_covered =
      manifest.begin == manifest.end ||
      (!manifest.part_files.empty() && manifest.part_files.front().begin <= manifest.begin &&
       manifest.part_files.back().end == manifest.end);
  if (!is_covered) Fail(source, "expected the files under 'segments' to hold all rows");
  return manifest;
}

}  // namespace slalom::replay
