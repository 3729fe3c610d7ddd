#include "app/train/collector.h"

#include <utility>

#include "base/machine.h"

namespace slalom::train {

InlineCollector::InlineCollector(actor::Actor& actor, policy::PolicyAgent& agent,
                                 const env::StepShape& shape)
    : actor_(actor), agent_(agent), free_(std::make_unique<replay::Chunk>(shape)) {}

std::unique_ptr<replay::Chunk> InlineCollector::Next() {
  if (stopped_) return nullptr;
  free_->Clear();
  actor_.Step(free_.get());
  return std::move(free_);
}

void InlineCollector::Recycle(std::unique_ptr<replay::Chunk> chunk) { free_ = std::move(chunk); }

void InlineCollector::Publish(policy::PolicySnapshot snapshot) {
  agent_.SetSnapshot(std::move(snapshot));
}

ThreadedCollector::ThreadedCollector(actor::Actor& actor, policy::PolicyAgent& agent,
                                     const env::StepShape& shape, int queue_length)
    : actor_(actor),
      agent_(agent),
      full_(static_cast<std::size_t>(queue_length)),
      free_(static_cast<std::size_t>(queue_length) + 2) {
  // One chunk with the actor, one with the learner, the rest in the queue.
  for (int i = 0; i < queue_length + 2; ++i) {
    SLALOM_CHECK(free_.Push(std::make_unique<replay::Chunk>(shape)));
  }
  thread_ = base::StartThread("the actor", [this] { Run(); });
}

ThreadedCollector::~ThreadedCollector() {
  free_.Close();
  full_.Close();
}

void ThreadedCollector::Stop() {
  // The actor still fills the chunks that are free, no others, and closes `full_` after the last.
  free_.Close();
}

void ThreadedCollector::Run() {
  try {
    while (auto chunk = free_.Pop()) {
      TakePolicy();
      (*chunk)->Clear();
      actor_.Step(chunk->get());
      if (!full_.Push(std::move(*chunk))) break;
    }
    TakePolicy();
  } catch (...) {
    base::MutexLock lock(mutex_);
    error_ = std::current_exception();
  }
  full_.Close();
}

void ThreadedCollector::TakePolicy() {
  std::optional<policy::PolicySnapshot> snapshot;
  {
    base::MutexLock lock(mutex_);
    snapshot.swap(published_);
  }
  if (snapshot) agent_.SetSnapshot(std::move(*snapshot));
}

std::unique_ptr<replay::Chunk> ThreadedCollector::Next() {
  if (auto chunk = full_.Pop()) return std::move(*chunk);
  base::MutexLock lock(mutex_);
  if (error_) std::rethrow_exception(error_);
  return nullptr;
}

void ThreadedCollector::Recycle(std::unique_ptr<replay::Chunk> chunk) {
  // A closed queue means that the actor is ending: the chunk is not needed any more.
  static_cast<void>(free_.Push(std::move(chunk)));
}

void ThreadedCollector::Publish(policy::PolicySnapshot snapshot) {
  base::MutexLock lock(mutex_);
  published_ = std::move(snapshot);
}

}  // namespace slalom::train
