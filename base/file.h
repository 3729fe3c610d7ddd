#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace slalom::base {

/// The whole of a file. Throws `Error` that names it where it cannot be read, or never ends.
std::string ReadFile(const std::filesystem::path& path);

/// Replaces `path` by `content` so that after a crash at any moment either the old or the new file
/// is there whole: written beside it, synced, renamed. Throws `Error` where that fails (no space,
/// no permission); the old file is then untouched and no temporary is left. Several processes may
/// write one file at once: the last one to finish stays.
///
/// A symbolic link stays, and the file that it points to is replaced. What is there and is no
/// regular file (a device, a pipe, /dev/stdout) is not replaced but written to, which is not
/// atomic.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

/// As above for content in several pieces that need not lie in memory at once: `write` is called
/// once with a function that appends bytes.
using AppendBytes = std::function<void(std::span<const std::byte>)>;
void WriteFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const AppendBytes&)>& write);

/// Whether `WriteFileAtomically` would write to what is at `path` and not replace it. Throws
/// `Error` where a directory is there.
[[nodiscard]] bool IsStream(const std::filesystem::path& path);

/// Makes the names in a directory outlast a loss of power, as far as its file system can.
void SyncDirectory(const std::filesystem::path& path);

/// Whether anything is at `path`. Throws `Error` if that cannot be found out.
[[nodiscard]] bool Exists(const std::filesystem::path& path);

/// Returns the paths of all that is in a directory, in no order. Empty if there is no such
/// directory. Throws `Error` if it cannot be read to its end.
std::vector<std::filesystem::path> ListDirectory(const std::filesystem::path& path);

/// Makes the directory and its parents. Throws `Error` where that fails.
void MakeDirectories(const std::filesystem::path& path);

/// XXH3, 64 bits, of the bytes: the checksum of every binary file and message of this project.
std::uint64_t Checksum(std::span<const std::byte> bytes, std::uint64_t seed = 0);
std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed = 0);

}  // namespace slalom::base
