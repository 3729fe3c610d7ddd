#include "sim/scene_stream.h"

#include <utility>

#include "base/check.h"

namespace slalom::sim {

SceneStream::SceneStream(FreshMix mix, std::uint64_t seed, int capacity)
    : mix_(std::move(mix)), seed_(seed), capacity_(static_cast<std::size_t>(capacity)) {
  SLALOM_CHECK(!mix_.empty());
  SLALOM_CHECK_GE(capacity, 1);
}

std::shared_ptr<const Scene> SceneStream::Get(int number) {
  base::MutexLock lock(mutex_);
  if (const auto place = places_.find(number); place != places_.end()) {
    kept_.splice(kept_.begin(), kept_, place->second);
  } else {
    kept_.push_front({number, MakeScene(std::make_shared<const Course>(
                                  GenerateStreamCourse(mix_, seed_, number)))});
    places_[number] = kept_.begin();
    if (kept_.size() > capacity_) {
      places_.erase(kept_.back().number);
      kept_.pop_back();
    }
  }
  return kept_.front().scene;
}

}  // namespace slalom::sim
