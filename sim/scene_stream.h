#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <unordered_map>

#include "base/mutex.h"
#include "sim/courses/course_stream.h"
#include "sim/scene.h"

namespace slalom::sim {

/// The scenes of the fresh courses of a training, made when they are asked for and kept while they
/// are in use. May be used by several threads.
class SceneStream {
 public:
  /// Keeps the `capacity` scenes that were asked for last. The scenes do not depend on it.
  /// Requires: !mix.empty(), capacity >= 1.
  SceneStream(FreshMix mix, std::uint64_t seed, int capacity);

  /// The scene of `GenerateStreamCourse(mix, seed, number)`. Requires: number >= 0.
  std::shared_ptr<const Scene> Get(int number) EXCLUDES(mutex_);

 private:
  struct Kept {
    int number = 0;
    std::shared_ptr<const Scene> scene;
  };

  const FreshMix mix_;
  const std::uint64_t seed_;
  const std::size_t capacity_;
  base::Mutex mutex_;
  std::list<Kept> kept_ GUARDED_BY(mutex_);  // The one asked for last comes first.
  std::unordered_map<int, std::list<Kept>::iterator> places_ GUARDED_BY(mutex_);
};

}  // namespace slalom::sim
