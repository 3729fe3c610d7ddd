#include "actor/service/outbox.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/bytes.h"
#include "base/check.h"
#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

constexpr std::string_view kSpoolMagic = "SLSPOOL1";

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
  base::ByteWriter out;
  out.PutText(kSpoolMagic);
  out.Put(session_);
  out.Put(static_cast<std::uint32_t>(num_streams));
  out.Put(static_cast<std::uint32_t>(chunks_.size()));
  for (const auto& [header, payload] : chunks_) {
    out.Put(header.sequence);
    out.Put(static_cast<std::uint32_t>(header.num_rows));
    out.Put(static_cast<std::uint32_t>(header.num_beams));
    out.Put(static_cast<std::uint32_t>(header.num_steps));
    out.Put(static_cast<std::uint32_t>(payload.size()));
    out.Put(header.oldest_version);
    out.Put(header.newest_version);
    out.PutBytes(payload.bytes());
  }
  out.Put(base::Checksum(out.text()));
  base::WriteFileAtomically(path, out.text());
}

std::optional<int> Outbox::LoadSpool(const std::filesystem::path& path) {
  if (!base::Exists(path)) return std::nullopt;
  const auto require = [&path](bool is_sound) {
    if (is_sound) return;
    throw DamagedSpool(fmt::format("{}: damaged or not an actor's spool", path.string()));
  };
  const std::string bytes = base::ReadFile(path);
  require(bytes.size() >= kSpoolMagic.size() + sizeof(std::uint64_t));
  const std::string_view content =
      std::string_view(bytes).substr(0, bytes.size() - sizeof(std::uint64_t));
  require(base::ByteReader(std::string_view(bytes).substr(content.size())).Get<std::uint64_t>() ==
          base::Checksum(content));
  base::ByteReader in(content);
  require(in.GetText(kSpoolMagic.size()) == kSpoolMagic);
  const auto session = in.Get<std::uint64_t>();
  const auto num_streams = in.Get<std::uint32_t>();
  const auto num_chunks = in.Get<std::uint32_t>();
  require(num_streams <= proto::kMaxStreams && session != 0);
  Begin(session);
  for (std::uint32_t i = 0; i < num_chunks; ++i) {
    OutgoingChunk chunk;
    chunk.header.session = session;
    chunk.header.sequence = in.Get<std::uint64_t>();
    chunk.header.num_rows = static_cast<int>(in.Get<std::uint32_t>());
    chunk.header.num_beams = static_cast<int>(in.Get<std::uint32_t>());
    chunk.header.num_steps = static_cast<int>(in.Get<std::uint32_t>());
    const auto size = in.Get<std::uint32_t>();
    chunk.header.oldest_version = in.Get<std::int64_t>();
    chunk.header.newest_version = in.Get<std::int64_t>();
    chunk.payload = transport::Frame::Copy(in.GetText(size));
    // Numbers that no actor wrote could not be sent.
    require(!in.failed() && proto::FindFault(chunk.header).empty());
    require(i == 0 || chunk.header.sequence == next_sequence_);
    next_sequence_ = chunk.header.sequence + 1;
    bytes_ += size;
    steps_ += chunk.header.num_steps;
    chunks_.push_back(std::move(chunk));
  }
  require(in.done());
  return static_cast<int>(num_streams);
}

}  // namespace slalom::actor
