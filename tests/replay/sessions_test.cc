#include "replay/sessions.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "base/random.h"

namespace slalom::replay {
namespace {

Session Of(std::uint32_t id, const std::string& name, std::int32_t base, std::int32_t count) {
  Session session;
  session.id = id;
  session.name = name;
  session.number = 1;
  session.stream_base = base;
  session.num_streams = count;
  return session;
}

// Against a list of streams: actors come, go, come back and are forgotten.
TEST(SessionsTest, StreamsAndIdsAreThoseOfAList) {
  constexpr int kStreams = 128;
  constexpr int kActors = 12;
  base::Random random(4);
  Sessions sessions;
  std::vector<std::uint32_t> owner(kStreams, 0);
  std::set<std::uint32_t> ids;
  const auto lowest_free = [&](int count) {
    for (int base = 0;; ++base) {
      const auto begin = owner.begin() + base;
      if (std::all_of(begin, begin + count, [](std::uint32_t id) { return id == 0; })) return base;
    }
  };
  for (int i = 0; i < 1000; ++i) {
    const std::string name = fmt::format("actor-{}", random.UniformInt(kActors));
    const Session* const known = sessions.FindName(name);
    const int count = 1 + static_cast<int>(random.UniformInt(4));
    const int base = lowest_free(count);
    ASSERT_EQ(sessions.FreeBase(count), base);
    Session session = Of(sessions.next_id(), name, base, count);
    if (known != nullptr) {
      session = *known;
      session.ended = random.Uniform() < 0.5;
      if (!session.ended) {
        ++session.number;
        session.stream_base = base;
        session.num_streams = count;
      }
    } else {
      ASSERT_TRUE(ids.insert(session.id).second) << "an id is used twice";
    }
    const auto freed = sessions.Put(session);
    ASSERT_TRUE(freed.ok()) << freed.failure().text;
    std::int32_t num_freed = 0;
    for (const std::uint32_t id : owner) num_freed += id == session.id;
    EXPECT_EQ(freed->count, num_freed);
    std::replace(owner.begin(), owner.end(), session.id, 0u);
    if (!session.ended) std::fill_n(owner.begin() + base, count, session.id);
    ASSERT_EQ(*sessions.FindName(name), session);
    if (random.Uniform() < 0.5) continue;
    EXPECT_EQ(sessions.Forget(session.id), session.ended);
    if (session.ended) EXPECT_EQ(sessions.FindName(name), nullptr);
  }
}

TEST(SessionsTest, AtTheLimitOfNamesTheKnownOnesMayComeBack) {
  Sessions sessions;
  for (int i = 0; i < Sessions::kMaxNames; ++i) {
    const auto id = static_cast<std::uint32_t>(i + 1);
    Session session = Of(id, fmt::format("actor-{}", i), i, 1);
    session.ended = true;
    ASSERT_TRUE(sessions.Put(session).ok());
  }
  const std::uint32_t next = sessions.next_id();
  EXPECT_FALSE(sessions.Put(Of(next, "one-more", Sessions::kMaxNames, 1)).ok());
  Session again = *sessions.FindName("actor-7");
  again.number = 2;
  again.ended = false;
  EXPECT_TRUE(sessions.Put(again).ok());
  again.ended = true;
  EXPECT_TRUE(sessions.Put(again).ok());
  EXPECT_EQ(sessions.next_id(), next) << "it is that of a name which comes later";
  ASSERT_TRUE(sessions.Forget(again.id));
  EXPECT_TRUE(sessions.Put(Of(next, "one-more", Sessions::kMaxNames, 1)).ok());
}

}  // namespace
}  // namespace slalom::replay
