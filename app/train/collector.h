#pragma once

#include <exception>
#include <memory>
#include <optional>
#include <thread>

#include "actor/actor.h"
#include "base/bounded_queue.h"
#include "base/mutex.h"
#include "policy/policy_agent.h"
#include "replay/chunk.h"

namespace slalom::train {

/// The source of the learner's data: an actor, in this thread or in its own. Confined to the
/// learner's thread.
class Collector {
 public:
  virtual ~Collector() = default;

  /// Returns the next batch step of the actor, or null once the actor has stopped and all its steps
  /// have been returned. Throws what the actor threw. Give the chunk back with `Recycle`.
  virtual std::unique_ptr<replay::Chunk> Next() = 0;
  virtual void Recycle(std::unique_ptr<replay::Chunk> chunk) = 0;

  /// Gives the actor's agent a new policy between two steps, or at the latest when it stops; an
  /// older one not yet taken is forgotten.
  virtual void Publish(policy::PolicySnapshot snapshot) = 0;

  /// Stops the actor. Call `Next` until it returns null: then actor and agent belong to the caller
  /// again, and none of their steps is lost.
  virtual void Stop() = 0;
};

/// Steps the actor inside `Next`: lockstep, for deterministic runs.
class InlineCollector : public Collector {
 public:
  /// `actor` and its `agent` must outlive the collector.
  InlineCollector(actor::Actor& actor, policy::PolicyAgent& agent, const env::StepShape& shape);

  std::unique_ptr<replay::Chunk> Next() override;
  void Recycle(std::unique_ptr<replay::Chunk> chunk) override;
  void Publish(policy::PolicySnapshot snapshot) override;
  void Stop() override { stopped_ = true; }

 private:
  actor::Actor& actor_;
  policy::PolicyAgent& agent_;
  std::unique_ptr<replay::Chunk> free_;
  bool stopped_ = false;
};

/// Steps the actor in a thread of its own, at most `queue_length` batch steps ahead of the learner.
class ThreadedCollector : public Collector {
 public:
  /// Starts the thread. `actor` and `agent` must outlive the collector and belong to the thread,
  /// except for `stats`.
  ThreadedCollector(actor::Actor& actor, policy::PolicyAgent& agent, const env::StepShape& shape,
                    int queue_length);
  ~ThreadedCollector() override;

  std::unique_ptr<replay::Chunk> Next() override;
  void Recycle(std::unique_ptr<replay::Chunk> chunk) override;
  void Publish(policy::PolicySnapshot snapshot) override;
  void Stop() override;

 private:
  void Run();
  void TakePolicy();

  actor::Actor& actor_;
  policy::PolicyAgent& agent_;
  base::BoundedQueue<std::unique_ptr<replay::Chunk>> full_;
  base::BoundedQueue<std::unique_ptr<replay::Chunk>> free_;

  base::Mutex mutex_;
  std::optional<policy::PolicySnapshot> published_ GUARDED_BY(mutex_);
  std::exception_ptr error_ GUARDED_BY(mutex_);

  std::jthread thread_;
};

}  // namespace slalom::train
