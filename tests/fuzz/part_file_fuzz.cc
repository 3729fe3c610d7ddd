// Part files of the replay buffer: a table is loaded from a file whose checksums are right and
// whose rows are the input's.

#include <fstream>

#include "base/error.h"
#include "base/file.h"
#include "replay/manifest.h"
#include "replay/storage.h"
#include "tests/fuzz/fuzz_input.h"

namespace slalom::fuzz {
namespace {

/// Adds a column of a block and goes on with the block's checksum.
void AddColumn(Input* input, std::size_t size, std::string* file, std::uint64_t* checksum) {
  AlignedCopy column(input->TakeBytes(size), size);
  file->append(reinterpret_cast<const char*>(column.bytes().data()), size);
  *checksum = base::Checksum(column.bytes(), *checksum);
}

template <class T>
void Append(std::string* file, T value) {
  file->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

}  // namespace
}  // namespace slalom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path directory = fuzz::ScratchDirectory("part_file");
  fuzz::Input input(data, size);
  const int beams = input.TakeIn(1, 3);
  const std::int64_t begin = input.TakeIn(0, 5);
  const std::int64_t rows = input.TakeIn(1, 20);
  const std::int64_t overwritten = input.TakeIn(0, 20) % rows;
  const std::int64_t capacity = std::max<std::int64_t>(2, rows - overwritten + input.TakeIn(0, 3));
  const int streams = input.TakeIn(0, 5);
  const int cut = input.TakeIn(0, 31);

  std::string file = "SLRPLSEG";
  fuzz::Append(&file, std::uint32_t{1});
  fuzz::Append(&file, static_cast<std::uint32_t>(beams));
  fuzz::Append(&file, begin);
  fuzz::Append(&file, rows);
  fuzz::Append(&file, base::Checksum(std::string_view(file)));
  auto checksum = static_cast<std::uint64_t>(begin);
  const auto n = static_cast<std::size_t>(rows);
  for (const std::size_t width : {4, 1, 2 * beams, 16, 8, 4, 4}) {
    fuzz::AddColumn(&input, n * width, &file, &checksum);
  }
  fuzz::Append(&file, checksum);
  if (cut > 28) file.resize(file.size() - static_cast<std::size_t>(cut - 28));

  replay::Manifest manifest{.shape = beams,
                            .capacity = capacity,
                            .begin = begin + overwritten,
                            .end = begin + rows,
                            .open = {},
                            .part_files = {}};
  for (int s = 0; s < streams; ++s) manifest.open.push_back(static_cast<std::uint8_t>(s % 2));
  const auto digest = base::Checksum(std::as_bytes(std::span(&checksum, 1)));
  manifest.part_files.push_back({"replay-000000.rows", begin, begin + rows, digest});
  std::ofstream(directory / "replay-000000.rows", std::ios::binary) << file;
  try {
    replay::Storage storage(directory);
    const replay::Table table = storage.Load(replay::PrintManifest(manifest), "input");
    replay::SampledRows sampled;
    base::Random random(1);
    (void)table.SampleRows({.batch = 8, .history = 3, .n_step = 2}, random, &sampled);
  } catch (const base::Error&) {
  }
  return 0;
}
