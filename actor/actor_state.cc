#include "actor/actor_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "base/error.h"
#include "base/file.h"

namespace slalom::actor {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

constexpr std::string_view kMagic = "SLACTOR4";
// The version before had no costs.
constexpr std::string_view kMagicBefore = "SLACTOR3";

class Writer {
 public:
  template <class T>
  void operator()(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  static constexpr bool has_costs() { return true; }
  void Raw(std::string_view text) { bytes_.append(text); }
  template <class T, class Field>
  void List(const std::vector<T>& list, Field field) {
    (*this)(static_cast<std::uint64_t>(list.size()));
    for (const T& item : list) field(*this, item);
  }
  void Numbers(const std::vector<float>& numbers) {
    (*this)(static_cast<std::uint64_t>(numbers.size()));
    Raw({reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)});
  }
  std::string Take() {
    (*this)(base::Checksum(std::string_view(bytes_)));
    return std::move(bytes_);
  }

 private:
  std::string bytes_;
};

class Reader {
 public:
  Reader(std::string_view bytes, std::string_view source, bool has_costs)
      : bytes_(bytes), source_(source), has_costs_(has_costs) {}

  template <class T>
  void operator()(T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    std::memcpy(&value, Raw(sizeof(value)).data(), sizeof(value));
  }
  bool has_costs() const { return has_costs_; }
  std::string_view Raw(std::size_t size) {
    if (size > bytes_.size()) {
      throw base::Error(fmt::format("{}: actor state ends in the middle of a field", source_));
    }
    const std::string_view text = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return text;
  }
  /// Adds items one by one, only while bytes are left, whatever the stored length claims.
  template <class T, class Field>
  void List(std::vector<T>& list, Field field) {
    std::uint64_t size = 0;
    (*this)(size);
    if (size > bytes_.size()) {
      throw base::Error(fmt::format("{}: actor state has a list of {} items in {} bytes", source_,
                                    size, bytes_.size()));
    }
    list.clear();
    for (std::uint64_t i = 0; i < size; ++i) field(*this, list.emplace_back());
  }
  void Numbers(std::vector<float>& numbers) {
    std::uint64_t size = 0;
    (*this)(size);
    // A length beyond the bytes is left for `Raw` to refuse.
    const std::size_t count = std::min<std::uint64_t>(size, bytes_.size());
    const std::string_view raw = Raw(count * sizeof(float));
    numbers.resize(count);
    if (count > 0) std::memcpy(numbers.data(), raw.data(), raw.size());
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
  std::string_view source_;
  bool has_costs_;
};

/// The fields in the order of the file, for writing (const) and for reading.
template <class Stream, class Summary>
void VisitSummary(Stream& s, Summary& summary) {
  s(summary.outcome);
  s(summary.num_steps);
  s(summary.episode_return);
  if (s.has_costs()) s(summary.episode_cost);
}

template <class Stream, class Open>
void VisitOpen(Stream& s, Open& open) {
  s(open.number);
  s(open.spec.course);
  s(open.spec.seed);
  s(open.is_learnable);
  for (auto& word : open.noise) s(word);
  s(open.episode_return);
  if (s.has_costs()) s(open.episode_cost);
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
  Writer writer;
  writer.Raw(kMagic);
  VisitState(writer, *this);
  return writer.Take();
}

ActorState ActorState::Parse(std::string_view bytes, std::string_view source) {
  const bool is_known = bytes.starts_with(kMagic) || bytes.starts_with(kMagicBefore);
  if (bytes.size() < kMagic.size() + sizeof(std::uint64_t) || !is_known) {
    throw base::Error(
        fmt::format("{}: not an actor state (expected it to start with {})", source, kMagic));
  }
  const std::string_view content = bytes.substr(0, bytes.size() - sizeof(std::uint64_t));
  std::uint64_t expected = 0;
  std::memcpy(&expected, bytes.data() + content.size(), sizeof(expected));
  const std::uint64_t found = base::Checksum(content);
  if (found != expected) {
    throw base::Error(fmt::format("{}: actor state is damaged (checksum {:016x}, expected {:016x})",
                                  source, found, expected));
  }
  Reader reader(content, source, bytes.starts_with(kMagic));
  reader.Raw(kMagic.size());
  ActorState state;
  VisitState(reader, state);
  if (!reader.at_end()) {
    throw base::Error(fmt::format("{}: actor state has bytes after its end", source));
  }
  for (EpisodeSummary& summary : state.recent) {
    const auto outcome = static_cast<int>(summary.outcome);
    if (outcome < 1 || outcome >= env::kNumOutcomes) {
      throw base::Error(fmt::format("{}: actor state has an episode with outcome {}", source,
                                    static_cast<int>(summary.outcome)));
    }
    // The constraint counted these episodes, each of which a collision had ended.
    if (!reader.has_costs() && summary.outcome == env::Outcome::kCollision) {
      summary.episode_cost = 1.0f;
    }
  }
  return state;
}

}  // namespace slalom::actor
