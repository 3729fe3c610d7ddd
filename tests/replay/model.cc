#include "tests/replay/model.h"

#include <algorithm>

namespace slalom::replay {

ReplayModel::ReplayModel(std::int64_t capacity, const env::StepShape& shape, int num_streams,
                         std::uint64_t seed)
    : capacity_(capacity),
      shape_(shape),
      random_(seed),
      chunk_(shape),
      streams_(static_cast<std::size_t>(num_streams)) {}

ReplayModel::Row ReplayModel::MakeRow(std::uint8_t flags) {
  Row row;
  row.sequence = total_++;
  row.flags = flags;
  for (int i = 0; i < shape_.num_beams; ++i) {
    row.ranges_cm.push_back(static_cast<std::uint16_t>(random_.UniformInt(65536)));
  }
  for (int i = 0; i < shape_.state_size; ++i)
    row.state.push_back(static_cast<float>(random_.Normal()));
  row.action.resize(shape_.action_size);
  if (!(flags & kRowFinal)) {
    for (float& number : row.action) number = static_cast<float>(random_.Uniform());
    row.reward = static_cast<float>(random_.Normal());
    row.cost = random_.Uniform() < 0.3 ? 1.0f : 0.0f;
  }
  return row;
}

void ReplayModel::Advance(Table* table) {
  chunk_.Clear();
  const auto frame = [](const Row& row) { return env::FrameView{row.ranges_cm, row.state}; };
  for (std::size_t s = 0; s < streams_.size(); ++s) {
    if (random_.Uniform() < 0.1) continue;  // This stream lags.
    auto& episodes = streams_[s];
    if (!episodes.empty() && !episodes.back().final_row && random_.Uniform() < 0.02) {
      table->Cut(static_cast<int>(s));
      episodes.emplace_back();
    }
    if (episodes.empty() || episodes.back().final_row) episodes.emplace_back();
    Episode& episode = episodes.back();
    const bool first = episode.steps.empty();
    const double fate = random_.Uniform();
    const auto outcome = fate < 0.05   ? env::Outcome::kSuccess
                         : fate < 0.10 ? env::Outcome::kCollision
                         : fate < 0.17 ? env::Outcome::kTimeout
                                       : env::Outcome::kRunning;
    const env::StepResult result{.outcome = outcome};
    const auto flags = static_cast<std::uint8_t>((first ? kRowFirst : 0) |
                                                 (result.terminated() ? kRowTerminated : 0));
    const Row& row = episode.steps.emplace_back(MakeRow(flags));
    const std::pair place{static_cast<int>(s), static_cast<int>(episodes.size()) - 1};
    episode_of_[row.sequence] = place;
    chunk_.AddStep(static_cast<int>(s), first, frame(row), row.action,
                   {.reward = row.reward, .cost = row.cost, .outcome = outcome});
    if (result.ended()) {
      episode.final_row = MakeRow(kRowFinal);
      episode_of_[episode.final_row->sequence] = place;
      chunk_.AddFinal(static_cast<int>(s), frame(*episode.final_row));
    }
  }
  table->Insert(chunk_);
}

std::optional<ReplayModel::Transition> ReplayModel::Expect(std::int64_t sequence,
                                                           const SampleSpec& spec) const {
  const auto place = episode_of_.find(sequence);
  if (place == episode_of_.end() || sequence < oldest()) return std::nullopt;
  const Episode& episode = streams_[place->second.first][place->second.second];
  std::vector<const Row*> rows;
  for (const Row& row : episode.steps) rows.push_back(&row);
  const auto num_steps = static_cast<int>(rows.size());
  if (episode.final_row) rows.push_back(&*episode.final_row);
  const auto begin = static_cast<int>(
      std::find_if(rows.begin(), rows.end(), [&](auto* r) { return r->sequence == sequence; }) -
      rows.begin());
  if (begin >= num_steps) return std::nullopt;  // A final row.

  Transition transition;
  int end = begin;
  double factor = 1.0;
  bool terminated = false;
  while (end < num_steps && end - begin < spec.n_step) {
    transition.n_step_return += factor * rows[end]->reward;
    transition.cost_return += factor * rows[end]->cost;
    factor *= spec.gamma;
    terminated = rows[end]->flags & kRowTerminated;
    ++end;
  }
  if (end >= static_cast<int>(rows.size())) return std::nullopt;  // The frame after is not there.
  transition.discount = terminated ? 0.0 : factor;
  for (int h = spec.history - 1; h >= 0; --h) {
    transition.history.push_back(rows[std::max(0, begin - h)]);
    transition.next_history.push_back(rows[std::max(0, end - h)]);
  }
  if (transition.history.front()->sequence < oldest()) return std::nullopt;
  return transition;
}

std::vector<std::int64_t> ReplayModel::Eligible(const SampleSpec& spec) const {
  std::vector<std::int64_t> eligible;
  for (std::int64_t s = oldest(); s < total_; ++s) {
    if (Expect(s, spec)) eligible.push_back(s);
  }
  return eligible;
}

std::int64_t ReplayModel::num_steps() const {
  std::int64_t count = 0;
  for (const auto& episodes : streams_) {
    for (const Episode& episode : episodes) {
      for (const Row& row : episode.steps) count += row.sequence >= oldest();
    }
  }
  return count;
}

}  // namespace slalom::replay
