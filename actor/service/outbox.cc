#include "actor/service/outbox.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

constexpr char kSpoolMagic[8] = {'S', 'L', 'S', 'P', 'O', 'O', 'L', '1'};

template <class T>
void Append(std::string& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

/// Reads values off the front of the bytes of a spool file.
class Reader {
 public:
  Reader(std::string_view bytes, std::string source) : bytes_(bytes), source_(std::move(source)) {}

  template <class T>
  T Read() {
    T value;
    std::memcpy(&value, Take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string_view Take(std::size_t size) {
    if (size > bytes_.size()) Fail();
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  [[noreturn]] void Fail() const {
    throw DamagedSpool(fmt::format("{}: damaged or not an actor's spool", source_));
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
  std::string source_;
};

}  // namespace

void Outbox::Begin(std::uint64_t session) {
  session_ = session;
  next_sequence_ = sent_before_ = 0;
  chunks_.clear();
  num_sent_ = 0;
  bytes_ = sent_bytes_ = steps_ = 0;
}

void Outbox::Add(proto::Insert header, transport::Frame payload) {
  header.session = session_;
  header.sequence = next_sequence_++;
  bytes_ += static_cast<std::int64_t>(payload.size());
  steps_ += header.num_steps;
  chunks_.push_back({header, std::move(payload)});
}

const OutgoingChunk* Outbox::NextToSend(std::int64_t window_bytes) const {
  if (num_sent_ == chunks_.size()) return nullptr;
  const OutgoingChunk& next = chunks_[num_sent_];
  const auto size = static_cast<std::int64_t>(next.payload.size());
  const bool alone = num_sent_ == 0 && window_bytes > 0;
  return alone || sent_bytes_ + size <= window_bytes ? &next : nullptr;
}

void Outbox::MarkSent() {
  SLALOM_CHECK_LT(num_sent_, chunks_.size());
  const OutgoingChunk& chunk = chunks_[num_sent_++];
  sent_bytes_ += static_cast<std::int64_t>(chunk.payload.size());
  if (chunk.header.sequence < sent_before_) ++resent_;
  sent_before_ = std::max(sent_before_, chunk.header.sequence + 1);
}

int Outbox::Acknowledge(std::uint64_t next_sequence) {
  const int chunks = num_chunks();
  while (!chunks_.empty() && chunks_.front().header.sequence < next_sequence) {
    const OutgoingChunk& chunk = chunks_.front();
    const auto size = static_cast<std::int64_t>(chunk.payload.size());
    steps_ -= chunk.header.num_steps;
    bytes_ -= size;
    if (num_sent_ > 0) {
      --num_sent_;
      sent_bytes_ -= size;
    }
    chunks_.pop_front();
  }
  return chunks - num_chunks();
}

bool Outbox::Resume(std::uint64_t next_sequence) {
  const std::uint64_t first = chunks_.empty() ? next_sequence_ : chunks_.front().header.sequence;
  if (next_sequence < first || next_sequence > next_sequence_) return false;
  num_sent_ = static_cast<std::size_t>(next_sequence - first);
  sent_bytes_ = 0;
  for (std::size_t i = 0; i < num_sent_; ++i) {
    sent_bytes_ += static_cast<std::int64_t>(chunks_[i].payload.size());
  }
  return true;
}

void Outbox::SaveSpool(const std::filesystem::path& path, int num_streams) const {
  if (chunks_.empty()) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    return;
  }
  std::string bytes(kSpoolMagic, sizeof(kSpoolMagic));
  Append(bytes, session_);
  Append(bytes, static_cast<std::uint32_t>(num_streams));
  Append(bytes, static_cast<std::uint32_t>(chunks_.size()));
  for (const auto& [header, payload] : chunks_) {
    Append(bytes, header.sequence);
    Append(bytes, static_cast<std::uint32_t>(header.num_rows));
    Append(bytes, static_cast<std::uint32_t>(header.num_beams));
    Append(bytes, static_cast<std::uint32_t>(header.num_steps));
    Append(bytes, static_cast<std::uint32_t>(payload.size()));
    Append(bytes, header.oldest_version);
    Append(bytes, header.newest_version);
    const auto rows = payload.bytes();
    bytes.append(reinterpret_cast<const char*>(rows.data()), rows.size());
  }
  Append(bytes, base::Checksum(std::string_view(bytes)));
  base::WriteFileAtomically(path, bytes);
}

std::optional<int> Outbox::LoadSpool(const std::filesystem::path& path) {
  if (!base::Exists(path)) return std::nullopt;
  const std::string bytes = base::ReadFile(path);
  Reader whole(bytes, path.string());
  if (bytes.size() < sizeof(kSpoolMagic) + sizeof(std::uint64_t)) whole.Fail();
  Reader in(whole.Take(bytes.size() - sizeof(std::uint64_t)), path.string());
  if (whole.Read<std::uint64_t>() !=
      base::Checksum(std::string_view(bytes).substr(0, bytes.size() - sizeof(std::uint64_t)))) {
    whole.Fail();
  }
  if (in.Take(sizeof(kSpoolMagic)) != std::string_view(kSpoolMagic, sizeof(kSpoolMagic))) in.Fail();
  const auto session = in.Read<std::uint64_t>();
  const auto num_streams = in.Read<std::uint32_t>();
  const auto num_chunks = in.Read<std::uint32_t>();
  if (num_streams > proto::kMaxStreams || session == 0) in.Fail();
  Begin(session);
  for (std::uint32_t i = 0; i < num_chunks; ++i) {
    OutgoingChunk chunk;
    chunk.header.session = session;
    chunk.header.sequence = in.Read<std::uint64_t>();
    chunk.header.num_rows = static_cast<int>(in.Read<std::uint32_t>());
    chunk.header.num_beams = static_cast<int>(in.Read<std::uint32_t>());
    chunk.header.num_steps = static_cast<int>(in.Read<std::uint32_t>());
    const auto size = in.Read<std::uint32_t>();
    chunk.header.oldest_version = in.Read<std::int64_t>();
    chunk.header.newest_version = in.Read<std::int64_t>();
    chunk.payload = transport::Frame::Copy(in.Take(size));
    // Numbers that no actor wrote could not be sent.
    if (!proto::FindFault(chunk.header).empty()) in.Fail();
    if (i > 0 && chunk.header.sequence != next_sequence_) in.Fail();
    next_sequence_ = chunk.header.sequence + 1;
    bytes_ += size;
    steps_ += chunk.header.num_steps;
    chunks_.push_back(std::move(chunk));
  }
  if (!in.at_end()) in.Fail();
  return static_cast<int>(num_streams);
}

}  // namespace slalom::actor
