#include "replay/storage.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <fstream>
#include <set>
#include <type_traits>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "replay/manifest.h"
#include "replay/rows.h"

namespace slalom::replay {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "part files are little-endian");

constexpr char kMagic[8] = {'S', 'L', 'R', 'P', 'L', 'S', 'E', 'G'};
constexpr std::uint32_t kVersion = 1;
constexpr std::int64_t kBlockRows = 1024;
constexpr std::string_view kPrefix = "replay-";
constexpr std::string_view kSuffix = ".rows";

struct Header {
  char magic[8];
  std::uint32_t version;
  std::uint32_t num_beams;
  std::int64_t begin;
  std::int64_t num_rows;
  std::uint64_t checksum;  // Checksum of the bytes before.
};
static_assert(sizeof(Header) == 40 && std::is_trivially_copyable_v<Header>);

std::uint64_t ChecksumOf(const Header& header) {
  return base::Checksum(std::as_bytes(std::span(&header, 1)).first(offsetof(Header, checksum)));
}

template <class T>
std::span<const std::byte> BytesOf(const std::vector<T>& column) {
  return std::as_bytes(std::span(column));
}

/// The columns of a block in the order of the file.
template <class ChunkType, class Visit>
void ForEachColumn(ChunkType& chunk, Visit visit) {
  visit(chunk.stream, 1);
  visit(chunk.flags, 1);
  visit(chunk.ranges_cm, chunk.shape.num_beams);
  visit(chunk.state, chunk.shape.state_size);
  visit(chunk.action, chunk.shape.action_size);
  visit(chunk.reward, 1);
  visit(chunk.cost, 1);
}

std::uint64_t ChecksumOf(const Chunk& block, std::int64_t begin) {
  auto checksum = static_cast<std::uint64_t>(begin);
  ForEachColumn(block, [&](const auto& column, int) {
    checksum = base::Checksum(BytesOf(column), checksum);
  });
  return checksum;
}

std::uint64_t Digest(const std::vector<std::uint64_t>& checksums) {
  return base::Checksum(BytesOf(checksums));
}

void CopyRows(const Table& table, std::int64_t begin, std::int64_t end, Chunk* block) {
  block->Clear();
  for (std::int64_t s = begin; s < end; ++s) block->AddRow(table.row(s));
}

/// The size of a part file in bytes.
std::int64_t FileSize(const env::StepShape& shape, std::int64_t num_rows) {
  return static_cast<std::int64_t>(sizeof(Header)) + Storage::BytesOfRows(shape, num_rows);
}

bool IsPartFileName(std::string_view name) {
  return name.starts_with(kPrefix) &&
         (name.ends_with(kSuffix) || name.ends_with(std::string(kSuffix) + ".tmp"));
}

std::vector<fs::path> ListPartFiles(const fs::path& directory) {
  std::vector<fs::path> paths = base::ListDirectory(directory);
  std::erase_if(paths,
                [](const fs::path& path) { return !IsPartFileName(path.filename().string()); });
  return paths;
}

[[noreturn]] void FailDamaged(const fs::path& path, std::string_view why) {
  throw base::Error("{}: damaged part of the replay buffer: {}; resume from another checkpoint",
                    path.string(), why);
}

}  // namespace

Storage::Storage(const fs::path& directory) : directory_(directory) {
  base::MakeDirectories(directory);
  for (const fs::path& path : ListPartFiles(directory)) {
    const std::string name = path.filename().string();
    std::int64_t index = 0;
    std::from_chars(name.data() + kPrefix.size(), name.data() + name.size(), index);
    next_index_ = std::max(next_index_, index + 1);
  }
}

std::int64_t Storage::BytesOfRows(const env::StepShape& shape, std::int64_t num_rows) {
  const auto row = static_cast<std::int64_t>(RowBytes::Size(1, shape));
  const std::int64_t num_blocks = (num_rows + kBlockRows - 1) / kBlockRows;
  return num_rows * row + num_blocks * 8;
}

std::string Storage::Save(const Table& table) {
  std::vector<PartFile> part_files = part_files_;
  const std::int64_t written = part_files.empty() ? 0 : part_files.back().end;
  SLALOM_CHECK_LE(written, table.total_inserted());
  const std::int64_t begin = std::max(written, table.first_sequence());
  // All that was written has been overwritten in the table.
  if (begin > written) part_files.clear();
  const std::size_t num_before = part_files.size();
  try {
    for (std::int64_t s = begin; s < table.total_inserted(); s = part_files.back().end) {
      part_files.push_back(
          WritePartFile(table, s, std::min(s + kPartFileRows, table.total_inserted())));
    }
  } catch (...) {
    // On a disk that is full, these would take the room of other files.
    std::error_code ignored;
    for (std::size_t i = num_before; i < part_files.size(); ++i) {
      fs::remove(directory_ / part_files[i].name, ignored);
    }
    throw;
  }
  std::erase_if(part_files, [&](const PartFile& s) { return s.end <= table.first_sequence(); });
  part_files_ = part_files;

  Manifest manifest{.shape = table.shape(),
                    .capacity = table.config().capacity,
                    .begin = table.first_sequence(),
                    .end = table.total_inserted(),
                    .open = {},
                    .part_files = part_files_};
  for (int s = 0; s < table.num_streams(); ++s) manifest.open.push_back(table.is_open(s));
  return PrintManifest(manifest);
}

Storage::PartFile Storage::WritePartFile(const Table& table, std::int64_t begin, std::int64_t end) {
  PartFile part{.name = fmt::format("{}{:06}{}", kPrefix, next_index_, kSuffix),
                .begin = begin,
                .end = end,
                .digest = 0};
  Header header{.magic = {},
                .version = kVersion,
                .num_beams = static_cast<std::uint32_t>(table.shape().num_beams),
                .begin = begin,
                .num_rows = part.end - begin,
                .checksum = 0};
  std::copy(std::begin(kMagic), std::end(kMagic), header.magic);
  header.checksum = ChecksumOf(header);
  std::vector<std::uint64_t> checksums;
  base::WriteFileAtomically(directory_ / part.name, [&](const base::AppendBytes& append) {
    append(std::as_bytes(std::span(&header, 1)));
    Chunk block(table.shape());
    for (std::int64_t s = begin; s < part.end; s += kBlockRows) {
      CopyRows(table, s, std::min(s + kBlockRows, part.end), &block);
      ForEachColumn(block, [&](const auto& column, int) { append(BytesOf(column)); });
      checksums.push_back(ChecksumOf(block, s));
      append(std::as_bytes(std::span(checksums).last(1)));
    }
  });
  part.digest = Digest(checksums);
  ++next_index_;
  return part;
}

void Storage::Commit(std::span<const std::string> manifests) {
  base::ThrowIf(manifests.empty(), "{}: no checkpoint names its part files, expected at least one",
                directory_.string());
  std::set<std::string> used;
  for (const std::string& manifest : manifests) {
    for (const PartFile& part : ParseManifest(manifest).part_files) used.insert(part.name);
  }
  for (const fs::path& path : ListPartFiles(directory_)) {
    std::error_code ignored;
    if (!used.contains(path.filename().string())) fs::remove(path, ignored);
  }
}

void Storage::DeleteAll() {
  std::error_code ignored;
  fs::remove_all(directory_, ignored);
}

void Storage::ReadPartFile(const PartFile& part, std::size_t num_streams, Table* table) const {
  const fs::path path = directory_ / part.name;
  std::ifstream in(path, std::ios::binary);
  base::ThrowIf(!in,
                "{}: cannot open this part of the replay buffer; resume from another checkpoint",
                path.string());
  const std::int64_t size = FileSize(table->shape(), part.end - part.begin);
  in.seekg(0, std::ios::end);
  if (in.tellg() != size) {
    FailDamaged(path,
                fmt::format("{} bytes long, expected {}", static_cast<long>(in.tellg()), size));
  }
  in.seekg(0);
  Header header;
  in.read(reinterpret_cast<char*>(&header), sizeof(header));
  if (!in || std::memcmp(header.magic, kMagic, sizeof(kMagic)) != 0 || header.version != kVersion ||
      header.checksum != ChecksumOf(header) ||
      header.num_beams != static_cast<std::uint32_t>(table->shape().num_beams) ||
      header.begin != part.begin || header.num_rows != part.end - part.begin) {
    FailDamaged(path, "its header is not the one that the checkpoint expects");
  }
  std::vector<std::uint64_t> checksums;
  Chunk block(table->shape());
  Chunk kept(table->shape());
  for (std::int64_t s = part.begin; s < part.end; s += kBlockRows) {
    const auto rows = static_cast<std::size_t>(std::min(kBlockRows, part.end - s));
    ForEachColumn(block, [&](auto& column, int width) {
      column.resize(rows * width);
      in.read(reinterpret_cast<char*>(column.data()),
              static_cast<std::streamsize>(std::as_bytes(std::span(column)).size()));
    });
    in.read(reinterpret_cast<char*>(&checksums.emplace_back()), sizeof(std::uint64_t));
    if (!in || checksums.back() != ChecksumOf(block, s)) {
      FailDamaged(path, fmt::format("the checksum of rows {} to {} does not match", s, s + rows));
    }
    for (const std::int32_t stream : block.stream) {
      if (stream < 0 || static_cast<std::size_t>(stream) >= num_streams) {
        FailDamaged(path,
                    fmt::format("rows {} to {} have a stream {}, the checkpoint has {} streams", s,
                                s + rows, stream, num_streams));
      }
    }
    // A part file may begin with rows that the table had already overwritten.
    kept.Clear();
    for (std::size_t r = 0; r < rows; ++r) {
      if (s + static_cast<std::int64_t>(r) >= table->total_inserted()) {
        kept.AddRow(block.row(static_cast<int>(r)));
      }
    }
    table->Insert(kept);
  }
  if (Digest(checksums) != part.digest) {
    FailDamaged(path, "it is not the file that the checkpoint was made with");
  }
}

Table Storage::Load(std::string_view text, std::string_view source) {
  const Manifest manifest = ParseManifest(text, source);
  Table table =
      Table::BeginRestore({.capacity = manifest.capacity}, manifest.shape, manifest.begin);
  for (const PartFile& part : manifest.part_files) ReadPartFile(part, manifest.open.size(), &table);
  table.FinishRestore(manifest.open);
  SLALOM_CHECK_EQ(table.total_inserted(), manifest.end);
  part_files_ = manifest.part_files;
  return table;
}

}  // namespace slalom::replay
