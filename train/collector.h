#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <thread>

#include "actor/actor.h"
#include "base/bounded_queue.h"
#include "base/mutex.h"
#include "replay/chunk.h"

namespace slalom::train {

/// Where the learner's data come from: an actor, in this thread or in its own. `Weights` is whatever the
/// actor's agent is refreshed with; the newest published is given to `refresh` between two steps.
///
/// Confined to the learner's thread.
class Collector {
 public:
  using Weights = std::shared_ptr<const void>;
  using Refresh = std::function<void(const Weights&)>;

  virtual ~Collector() = default;

  /// The next batch step of the actor. Null: the collector was stopped. Throws what the actor threw.
  /// The chunk goes back with `Recycle`.
  virtual std::unique_ptr<replay::Chunk> Next() = 0;
  virtual void Recycle(std::unique_ptr<replay::Chunk> chunk) = 0;

  /// Gives the actor new weights; an older value that it has not taken is forgotten.
  virtual void Publish(Weights weights) = 0;

  /// Wakes a waiting `Next`, which then returns null. Thread-safe.
  virtual void Stop() = 0;
};

/// Steps the actor inside `Next`: lockstep, for deterministic runs.
class InlineCollector : public Collector {
 public:
  /// `actor` must outlive the collector.
  InlineCollector(actor::Actor& actor, int num_beams, Refresh refresh);

  std::unique_ptr<replay::Chunk> Next() override;
  void Recycle(std::unique_ptr<replay::Chunk> chunk) override;
  void Publish(Weights weights) override;
  void Stop() override {}

 private:
  actor::Actor& actor_;
  const Refresh refresh_;
  std::unique_ptr<replay::Chunk> free_;
};

/// Steps the actor in a thread of its own, at most `queue_length` batch steps ahead of the learner.
class ThreadedCollector : public Collector {
 public:
  /// Starts the thread. `actor` must outlive the collector and is the thread's until then, but for `stats`.
  ThreadedCollector(actor::Actor& actor, int num_beams, int queue_length, Refresh refresh);
  ~ThreadedCollector() override;

  std::unique_ptr<replay::Chunk> Next() override;
  void Recycle(std::unique_ptr<replay::Chunk> chunk) override;
  void Publish(Weights weights) override;
  void Stop() override;

 private:
  void Run();
  Weights TakeWeights() EXCLUDES(mutex_);

  actor::Actor& actor_;
  const Refresh refresh_;
  base::BoundedQueue<std::unique_ptr<replay::Chunk>> full_;
  base::BoundedQueue<std::unique_ptr<replay::Chunk>> free_;

  base::Mutex mutex_;
  Weights weights_ GUARDED_BY(mutex_);
  std::exception_ptr error_ GUARDED_BY(mutex_);

  std::jthread thread_;
};

}  // namespace slalom::train
