#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// Reads TensorBoard event files as their format says, and shares no code with what writes them.

namespace slalom::test {

struct Event {
  double wall_time = 0.0;
  std::int64_t step = 0;
  std::string file_version;
  int session_status = 0;  ///< 1: start.
  std::map<std::string, float> scalars;
};

/// CRC32C by its definition: the remainder of a division of polynomials, bit by bit.
std::uint32_t Crc32c(std::string_view bytes);

/// Every record of the file, both checksums of each compared. Throws `std::runtime_error` that
/// says at which byte and why the file is not one.
std::vector<Event> ReadEvents(const std::filesystem::path& path);

/// Event files of a directory, in the order of their names.
std::vector<std::filesystem::path> EventFiles(const std::filesystem::path& directory);

/// What a reader shows of a directory: the events with scalars, without those that a later session
/// start superseded.
std::vector<Event> ReadRun(const std::filesystem::path& directory);

}  // namespace slalom::test
