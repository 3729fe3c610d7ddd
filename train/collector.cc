#include "train/collector.h"

#include <utility>

namespace slalom::train {

InlineCollector::InlineCollector(actor::Actor& actor, int num_beams, Refresh refresh)
    : actor_(actor),
      refresh_(std::move(refresh)),
      free_(std::make_unique<replay::Chunk>(num_beams)) {}

std::unique_ptr<replay::Chunk> InlineCollector::Next() {
  free_->Clear();
  actor_.Step(free_.get());
  return std::move(free_);
}

void InlineCollector::Recycle(std::unique_ptr<replay::Chunk> chunk) { free_ = std::move(chunk); }

void InlineCollector::Publish(Weights weights) { refresh_(weights); }

ThreadedCollector::ThreadedCollector(actor::Actor& actor, int num_beams, int queue_length,
                                     Refresh refresh)
    : actor_(actor),
      refresh_(std::move(refresh)),
      full_(static_cast<std::size_t>(queue_length)),
      free_(static_cast<std::size_t>(queue_length) + 2) {
  // One chunk with the actor, one with the learner, the rest in the queue.
  for (int i = 0; i < queue_length + 2; ++i) {
    SLALOM_CHECK(free_.Push(std::make_unique<replay::Chunk>(num_beams)));
  }
  thread_ = std::jthread([this] { Run(); });
}

ThreadedCollector::~ThreadedCollector() { Stop(); }

void ThreadedCollector::Stop() {
  full_.Close();
  free_.Close();
}

void ThreadedCollector::Run() {
  try {
    while (auto chunk = free_.Pop()) {
      if (const Weights weights = TakeWeights()) refresh_(weights);
      (*chunk)->Clear();
      actor_.Step(chunk->get());
      if (!full_.Push(std::move(*chunk))) return;
    }
  } catch (...) {
    {
      base::MutexLock lock(mutex_);
      error_ = std::current_exception();
    }
    Stop();
  }
}

std::unique_ptr<replay::Chunk> ThreadedCollector::Next() {
  auto chunk = full_.Pop();
  if (chunk) return std::move(*chunk);
  base::MutexLock lock(mutex_);
  if (error_) std::rethrow_exception(error_);
  return nullptr;
}

void ThreadedCollector::Recycle(std::unique_ptr<replay::Chunk> chunk) {
  // A closed queue means that the collector is being stopped: the chunk is not needed any more.
  static_cast<void>(free_.Push(std::move(chunk)));
}

void ThreadedCollector::Publish(Weights weights) {
  base::MutexLock lock(mutex_);
  weights_ = std::move(weights);
}

ThreadedCollector::Weights ThreadedCollector::TakeWeights() {
  base::MutexLock lock(mutex_);
  return std::exchange(weights_, nullptr);
}

}  // namespace slalom::train
