#include "tests/replay/journal_scene.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/file.h"
#include "replay/rows.h"

namespace slalom::replay {
namespace {

struct Payload {
  explicit Payload(std::size_t num_bytes) : words(num_bytes / 8 + 1), size(num_bytes) {}
  std::span<std::byte> bytes() { return std::as_writable_bytes(std::span(words)).first(size); }

  std::vector<std::uint64_t> words;
  std::size_t size;
};

}  // namespace

std::string JournalScene::Describe(const Table& table, const Sessions& sessions,
                                   std::int64_t from) {
  std::string text = fmt::format("rows to {}, {} steps ever, next id {}\n", table.total_inserted(),
                                 sessions.accepted_steps(), sessions.next_id());
  for (const auto& [id, s] : sessions.all()) {
    text += fmt::format("{} {} {} {} {} {} {} {} {}+{} {}\n", id, s.name, s.number, s.next_sequence,
                        s.accepted_steps, s.earlier_steps, s.previous_number,
                        s.previous_accepted_steps, s.stream_base, s.num_streams, s.ended);
    for (int i = s.stream_base; !s.ended && i < s.stream_base + s.num_streams; ++i) {
      text += table.is_open(i) ? '1' : '0';
    }
  }
  for (std::int64_t i = std::max(from, table.first_sequence()); i < table.total_inserted(); ++i) {
    const RowView row = table.row(i);
    text += fmt::format("{}: {} {} {} {} {}\n", i, row.stream, row.flags, row.frame.ranges_cm[0],
                        row.frame.state[1], row.reward);
  }
  // Windows and histories say how rows are linked.
  if (from > table.first_sequence()) return text;
  SampledRows rows;
  base::Random random(3);
  if (table.SampleRows({.batch = 16, .history = 2, .n_step = 2}, random, &rows)) {
    for (int b = 0; b < 16; ++b) {
      text += fmt::format("{}-{} ", rows.sequence[b], rows.next_sequence[b]);
    }
  }
  return text;
}

JournalScene::JournalScene(const std::filesystem::path& directory, std::int64_t capacity,
                           std::int64_t segment_bytes, std::uint64_t seed)
    : directory_(directory), capacity_(capacity), segment_bytes_(segment_bytes), random_(seed) {}

JournalOptions JournalScene::options() const {
  return {.directory = directory_,
          .segment_bytes = segment_bytes_,
          .sync_interval = std::chrono::milliseconds(1),
          .retry_interval = std::chrono::milliseconds(1),
          .shape = kBeams,
          .spec_hash = kSpecHash};
}

StateRecord JournalScene::State() const {
  StateRecord state{.first_row = table_->total_inserted(), .open = {}, .sessions = sessions_};
  for (int s = 0; s < table_->num_streams(); ++s) state.open.push_back(table_->is_open(s));
  return state;
}

std::vector<std::string> JournalScene::Open() {
  JournalLock lock(directory_);
  Recovered recovered = RecoverJournal(options(), config());
  table_ = std::make_unique<Table>(std::move(recovered.table));
  sessions_ = recovered.sessions;
  marks_.clear();
  segments_ = {{table_->total_inserted()}};
  offset_ = SegmentHead::kBytes;
  AddMark(PrintRecord(State()).size());
  appended_ = 1;
  journal_ = std::make_unique<Journal>(options(), std::move(lock), std::move(recovered.segments),
                                       recovered.next_index, State(), [this] {
                                         base::MutexLock guard(mutex_);
                                         written_changed_.NotifyAll();
                                       });
  return recovered.notes;
}

void JournalScene::AddMark(std::size_t record_bytes) {
  offset_ += static_cast<std::int64_t>(record_bytes);
  marks_.push_back({segments_.size() - 1, offset_, Describe(*table_, sessions_)});
}

void JournalScene::BeginSegment() {
  segments_.push_back({table_->total_inserted()});
  offset_ = SegmentHead::kBytes;
  AddMark(PrintRecord(State()).size());
  journal_->BeginSegment(State(), table_->first_sequence());
  ++appended_;
}

void JournalScene::Append(int count) {
  for (int i = 0; i < count; ++i) {
    if (journal_->segment_full()) BeginSegment();
    if (sessions_.all().empty() || random_.Uniform() < 0.1) {
      AppendSession();
    } else {
      AppendRows();
    }
  }
}

void JournalScene::Put(const Session& session) {
  const auto freed = sessions_.Put(session);
  ASSERT_TRUE(freed.ok()) << freed.failure().text;
  for (int s = freed->base; s < freed->base + freed->count; ++s) table_->Cut(s);
  appended_ = journal_->Append(SessionRecord{session});
  AddMark(PrintRecord(SessionRecord{session}).size());
}

void JournalScene::AppendSession() {
  const std::string name = fmt::format("actor-{}", random_.UniformInt(4));
  const Session* const known = sessions_.FindName(name);
  if (known != nullptr && random_.Uniform() < 0.5) {
    Session session = *known;
    session.ended = true;
    Put(session);
    if (random_.Uniform() < 0.3) {
      const ForgetRecord record{session.id};
      ASSERT_TRUE(sessions_.Forget(session.id));
      appended_ = journal_->Append(record);
      AddMark(PrintRecord(record).size());
    }
    return;
  }
  Session session;
  session.id = known ? known->id : sessions_.next_id();
  session.name = name;
  session.number = known ? known->number + 1 + random_.UniformInt(3) : 1;
  if (known) {
    session.earlier_steps = known->earlier_steps + known->accepted_steps;
    session.previous_number = known->number;
    session.previous_accepted_steps = known->accepted_steps;
  }
  session.num_streams = 1 + static_cast<int>(random_.UniformInt(3));
  session.stream_base = *sessions_.FreeBase(session.num_streams);
  Put(session);
}

void JournalScene::AppendRows() {
  std::vector<const Session*> open;
  for (const auto& [id, session] : sessions_.all()) {
    if (!session.ended) open.push_back(&session);
  }
  if (open.empty()) return AppendSession();
  const Session& session = *open[random_.UniformInt(open.size())];
  Chunk chunk(kBeams);
  int steps = 0;
  for (int s = 0; s < session.num_streams; ++s) {
    const std::vector<std::uint16_t> ranges(kBeams,
                                            static_cast<std::uint16_t>(random_.UniformInt(60000)));
    const std::vector<float> state(env::kStateSize, static_cast<float>(random_.Uniform()));
    const env::FrameView frame{ranges, state};
    const bool ends = random_.Uniform() < 0.2;
    chunk.AddStep(s, !table_->is_open(session.stream_base + s), frame, std::array{0.5f, 0.25f},
                  {.reward = static_cast<float>(random_.Uniform()),
                   .outcome = ends ? env::Outcome::kTimeout : env::Outcome::kRunning});
    ++steps;
    if (ends) chunk.AddFinal(s, frame);
  }
  auto payload = std::make_shared<Payload>(RowBytes::Size(chunk.num_rows(), kBeams));
  RowBytes::Write(chunk, payload->bytes());
  const RowsRecord record{.id = session.id,
                          .num_rows = chunk.num_rows(),
                          .num_steps = steps,
                          .sequence = session.next_sequence,
                          .first_row = table_->total_inserted(),
                          .rows = payload->bytes()};
  const auto rows =
      RowBytes::Parse(payload->bytes(), chunk.num_rows(), kBeams, session.num_streams);
  ASSERT_TRUE(rows.ok());
  table_->InsertRows(*rows, session.stream_base);
  ASSERT_FALSE(sessions_.Accept(session.id, session.next_sequence, steps));
  AddMark(PrintRecord(record).size());
  appended_ = journal_->Append(record, std::move(payload));
}

void JournalScene::WaitWritten() {
  base::MutexLock lock(mutex_);
  while (journal_->written() < appended_) written_changed_.Wait(mutex_);
}

}  // namespace slalom::replay
