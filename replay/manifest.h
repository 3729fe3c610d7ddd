#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "replay/storage.h"

namespace slalom::replay {

/// The content of a manifest (docs/replay.md).
struct Manifest {
  env::StepShape shape;
  std::int64_t capacity = 0;
  std::int64_t begin = 0;  ///< The table holds rows [begin, end).
  std::int64_t end = 0;
  std::vector<std::uint8_t> open;             ///< Per stream, 1 if an episode is running.
  std::vector<Storage::PartFile> part_files;  ///< Under the key "segments" in the text.
};

std::string PrintManifest(const Manifest& manifest);

/// Throws `base::Error`, with a message that starts with `source`, if the text was not made by
/// `PrintManifest`.
Manifest ParseManifest(std::string_view text, std::string_view source = "replay manifest");

}  // namespace slalom::replay
