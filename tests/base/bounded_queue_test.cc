#include "base/bounded_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace slalom::base {
namespace {

TEST(BoundedQueueTest, ItemsComeOutInTheOrderTheyWentIn) {
  BoundedQueue<int> queue(3);
  for (const int i : {1, 2, 3}) EXPECT_TRUE(queue.Push(i));
  EXPECT_EQ(queue.size(), 3u);
  for (const int i : {1, 2, 3}) EXPECT_EQ(queue.Pop(), i);
  EXPECT_EQ(queue.TryPop(), std::nullopt);
}

TEST(BoundedQueueTest, PushWaitsForAPlace) {
  BoundedQueue<int> queue(1);
  EXPECT_TRUE(queue.Push(1));
  std::jthread pusher([&] { EXPECT_TRUE(queue.Push(2)); });
  while (queue.num_waiting_push() == 0) std::this_thread::yield();
  EXPECT_EQ(queue.size(), 1u);
  EXPECT_EQ(queue.Pop(), 1);
  EXPECT_EQ(queue.Pop(), 2);
}

TEST(BoundedQueueTest, WhatIsInsideCanBePoppedAfterClose) {
  BoundedQueue<std::unique_ptr<int>> queue(2);
  EXPECT_TRUE(queue.Push(std::make_unique<int>(1)));
  queue.Close();
  EXPECT_FALSE(queue.Push(std::make_unique<int>(2)));
  EXPECT_EQ(**queue.Pop(), 1);
  EXPECT_EQ(queue.Pop(), std::nullopt);
}

TEST(BoundedQueueTest, CloseWakesThoseWhoWait) {
  BoundedQueue<int> full(1);
  EXPECT_TRUE(full.Push(1));
  BoundedQueue<int> empty(1);
  std::jthread pusher([&] { EXPECT_FALSE(full.Push(2)); });
  std::jthread popper([&] { EXPECT_EQ(empty.Pop(), std::nullopt); });
  while (full.num_waiting_push() == 0) std::this_thread::yield();
  full.Close();
  empty.Close();
}

TEST(BoundedQueueTest, EveryItemOfManyThreadsArrivesOnceAndInOrder) {
  constexpr int kPushers = 3;
  constexpr int kItems = 2000;
  BoundedQueue<std::pair<int, int>> queue(4);
  std::vector<std::jthread> pushers;
  for (int p = 0; p < kPushers; ++p) {
    pushers.emplace_back([&queue, p] {
      for (int i = 0; i < kItems; ++i) EXPECT_TRUE(queue.Push({p, i}));
    });
  }
  std::vector<int> next(kPushers, 0);
  for (int n = 0; n < kPushers * kItems; ++n) {
    const auto item = queue.Pop();
    ASSERT_TRUE(item);
    EXPECT_EQ(item->second, next[item->first]++);
    ASSERT_LE(queue.size(), 4u);
  }
}

}  // namespace
}  // namespace slalom::base
