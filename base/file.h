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

/// Reads a whole file. Throws `Error` that names it if it cannot be read, or if it never ends.
std::string ReadFile(const std::filesystem::path& path);

/// The same for a text file, without a byte order mark. Throws `Error` if its text is UTF-16, too.
std::string ReadTextFile(const std::filesystem::path& path);

/// Replaces `path` by `content` atomically: writes a file beside it, syncs it and renames it. After
/// a crash at any moment, either the old or the new file is complete. Throws `Error` if that fails
/// (no space, no permission); the old file is then untouched and no temporary file is left, except
/// that the new file may be there and not survive a loss of power if the directory cannot be
/// synced. Several processes may write one file at once: the content of the last to finish stays.
///
/// A symbolic link stays, and the file that it points to is replaced. If `path` is a device or pipe
/// (such as /dev/stdout), writes to it instead of replacing it, which is not atomic.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

/// As above, for content in several pieces that need not be in memory at once: `write` is called
/// once with a function that appends bytes.
using AppendBytes = std::function<void(std::span<const std::byte>)>;
void WriteFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const AppendBytes&)>& write);

/// Whether `path` is named as a file that `WriteFileAtomically` has not finished.
[[nodiscard]] bool IsUnfinishedFile(const std::filesystem::path& path);

/// Removes the temporary files that writers of files in `directory`, killed meanwhile, have left.
/// Requires: nobody writes there now.
void RemoveUnfinishedFiles(const std::filesystem::path& directory);

/// Whether `WriteFileAtomically` would write to `path` instead of replacing it. Throws `Error` if
/// `path` is a directory.
[[nodiscard]] bool IsStream(const std::filesystem::path& path);

/// Renames a file or directory. Throws `Error` if that fails.
void Rename(const std::filesystem::path& from, const std::filesystem::path& to);

/// Syncs the names in a directory, so that they survive a loss of power. Throws `Error` if that
/// fails. Does nothing on a file system that cannot do it.
void SyncDirectory(const std::filesystem::path& path);

/// Whether `path` exists. Throws `Error` if the system cannot tell.
[[nodiscard]] bool Exists(const std::filesystem::path& path);

/// Returns the paths of everything in a directory, in no order. Empty if there is no such
/// directory. Throws `Error` if it cannot be read to its end.
std::vector<std::filesystem::path> ListDirectory(const std::filesystem::path& path);

/// Returns a path of the directory that ends in its name, whatever way it was written.
std::filesystem::path NormalisedDirectory(const std::filesystem::path& directory);

/// Makes the directory and its parents, and syncs their names. Throws `Error` if that fails.
void MakeDirectories(const std::filesystem::path& path);

/// XXH3, 64 bits, of the bytes: the checksum of every binary file and message of this project.
std::uint64_t Checksum(std::span<const std::byte> bytes, std::uint64_t seed = 0);
std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed = 0);

}  // namespace slalom::base
