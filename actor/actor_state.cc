#include "actor/actor_state.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "base/bytes.h"
#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

constexpr std::string_view kMagic = "SLACTOR4";

class StateWriter {
 public:
  template <class T>
  void operator()(const T& value) {
    out_.Put(value);
  }
  template <class T, class Field>
  void List(const std::vector<T>& list, Field field) {
    out_.Put(std::uint64_t{list.size()});
    for (const T& item : list) field(*this, item);
  }
  void Numbers(const std::vector<float>& numbers) {
    out_.Put(std::uint64_t{numbers.size()});
    out_.PutBytes(std::as_bytes(std::span(numbers)));
  }
  base::ByteWriter& out() { return out_; }

 private:
  base::ByteWriter out_;
};

class StateReader {
 public:
  explicit StateReader(std::string_view content) : in_(content) {}

  template <class T>
  void operator()(T& value) {
    value = in_.Get<T>();
  }
  /// Adds items one by one, only while bytes are left, whatever the stored length claims.
  template <class T, class Field>
  void List(std::vector<T>& list, Field field) {
    const auto size = in_.Get<std::uint64_t>();
    for (std::uint64_t i = 0; i < size && !in_.failed(); ++i) field(*this, list.emplace_back());
  }
  void Numbers(std::vector<float>& numbers) {
    // More numbers than bytes are left for `GetBytes` to refuse.
    const std::uint64_t size = std::min<std::uint64_t>(in_.Get<std::uint64_t>(), in_.left() + 1);
    const std::span<const std::byte> raw = in_.GetBytes(size * sizeof(float));
    numbers.resize(raw.size() / sizeof(float));
    if (!raw.empty()) std::memcpy(numbers.data(), raw.data(), raw.size());
  }
  bool done() const { return in_.done(); }

 private:
  base::ByteReader in_;
};

/// The fields in the order of the file, for writing (const) and for reading.
template <class Stream, class Summary>
void VisitSummary(Stream& s, Summary& summary) {
  s(summary.outcome);
  s(summary.num_steps);
  s(summary.episode_return);
  s(summary.episode_cost);
}

template <class Stream, class Open>
void VisitOpen(Stream& s, Open& open) {
  s(open.number);
  s(open.spec.course);
  s(open.spec.seed);
  s(open.is_learnable);
  for (auto& word : open.noise) s(word);
  s(open.episode_return);
  s(open.episode_cost);
  s(open.frame_checksum);
  s.Numbers(open.actions);
}

template <class Stream, class Sampler>
void VisitSampler(Stream& s, Sampler& sampler) {
  s(sampler.num_fresh_draws);
  for (auto* courses : {&sampler.named, &sampler.candidates, &sampler.learnable, &sampler.recent}) {
    s.List(*courses, [](Stream& inner, auto& course) {
      inner(course.course);
      inner(course.num_successes);
      inner(course.num_failures);
    });
  }
}

template <class Stream, class State>
void VisitState(Stream& s, State& state) {
  s(state.seed);
  s(state.num_steps);
  s(state.num_episodes);
  s.List(state.recent, [](Stream& inner, auto& summary) { VisitSummary(inner, summary); });
  s.List(state.open, [](Stream& inner, auto& open) { VisitOpen(inner, open); });
  VisitSampler(s, state.sampler);
}

}  // namespace

std::string ActorState::Serialize() const {
  StateWriter writer;
  writer.out().PutText(kMagic);
  VisitState(writer, *this);
  writer.out().Put(base::Checksum(writer.out().text()));
  return std::string(writer.out().text());
}

ActorState ActorState::Parse(std::string_view bytes, std::string_view source) {
  base::ThrowIf(bytes.size() < kMagic.size() + sizeof(std::uint64_t) || !bytes.starts_with(kMagic),
                "{}: not an actor state (expected it to start with {})", source, kMagic);
  const std::string_view content = bytes.substr(0, bytes.size() - sizeof(std::uint64_t));
  const auto expected = base::ByteReader(bytes.substr(content.size())).Get<std::uint64_t>();
  const std::uint64_t found = base::Checksum(content);
  base::ThrowIf(found != expected,
                "{}: actor state is damaged (checksum {:016x}, expected {:016x})", source, found,
                expected);
  StateReader reader(content.substr(kMagic.size()));
  ActorState state;
  VisitState(reader, state);
  base::ThrowIf(!reader.done(), "{}: actor state is damaged: its fields do not take up its bytes",
                source);
  for (const EpisodeSummary& summary : state.recent) {
    const auto outcome = static_cast<int>(summary.outcome);
    base::ThrowIf(outcome < 1 || outcome >= env::kNumOutcomes,
                  "{}: actor state has an episode with outcome {}", source,
                  static_cast<int>(summary.outcome));
  }
  return state;
}

}  // namespace slalom::actor
