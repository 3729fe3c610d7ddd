// Header frames: as they came, and with a prefix that lets them through to the protobuf.

#include "base/file.h"
#include "proto/messages.h"
#include "tests/fuzz/fuzz_input.h"

namespace slalom::fuzz {
namespace {

void Decode(std::span<const std::byte> frame) {
  const auto header = proto::Decode(frame, {});
  if (!header) {
    Require(!header.failure().text.empty() && header.failure().text.size() < 1000);
    return;
  }
  // What was let in can be sent on, and is then understood in the same way.
  const std::string sent = proto::Encode(*header, {});
  const auto again = proto::Decode(std::as_bytes(std::span(sent)), {});
  Require(again.ok());
  Require(proto::Encode(*again, {}) == sent);
}

/// The frame with the number of a message that there is, and the right checksum.
std::string Mended(std::span<const std::byte> frame) {
  std::string mended(reinterpret_cast<const char*>(frame.data()), frame.size());
  mended[0] = 'S', mended[1] = mended[2] = 'L', mended[3] = 'M';
  mended[4] = static_cast<char>(proto::kMajorVersion);
  mended[6] = static_cast<char>(1 + static_cast<unsigned char>(mended[6]) %
                                        std::variant_size_v<proto::Header>);
  mended[7] = 0;
  std::uint64_t checksum = base::Checksum(std::string_view(mended).substr(0, 8));
  checksum = base::Checksum(std::string_view(mended).substr(16), checksum);
  checksum = base::Checksum(std::string_view(), checksum);
  std::memcpy(mended.data() + 8, &checksum, sizeof(checksum));
  return mended;
}

}  // namespace
}  // namespace slalom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto frame = std::as_bytes(std::span(data, size));
  slalom::fuzz::Decode(frame);
  if (size >= slalom::proto::kPrefixBytes) {
    const std::string mended = slalom::fuzz::Mended(frame);
    slalom::fuzz::Decode(std::as_bytes(std::span(mended)));
  }
  return 0;
}
