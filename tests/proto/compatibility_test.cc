// An older and a newer minor version talk, in both directions; another major version does not.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/proto/examples.h"
#include "tests/proto/newer.pb.h"

namespace slalom::proto {
namespace {

using testing::HasSubstr;

constexpr int kHello = 1;
constexpr int kSampleRequest = 6;
constexpr int kStatusReply = 13;
constexpr int kWeather = 15;

newer::Hello NewerHello() {
  newer::Hello hello;
  hello.set_role("actor");
  hello.set_name("actor-3");
  hello.set_session(7);
  hello.set_num_beams(720);
  hello.set_num_streams(16);
  newer::Camera* const camera = hello.add_cameras();
  camera->set_width(640);
  camera->set_calibration(std::string("\xff\x00\xfe", 3));
  hello.add_cameras()->set_width(320);
  hello.set_shard(0xfedcba9876543210);
  hello.set_zone(5);
  (*hello.mutable_labels())["rack"] = "b";
  hello.set_offset(-5);
  return hello;
}

TEST(CompatibilityTest, FieldsOfANewerMinorVersionArePassedOver) {
  const std::string frame =
      FrameByHand(1, kMinorVersion + 1, kHello, NewerHello().SerializeAsString());
  const auto decoded = Decode(Bytes(frame), {});
  ASSERT_TRUE(decoded) << decoded.failure().text;
  EXPECT_EQ(Print(*decoded), Print(Hello{.role = "actor",
                                         .name = "actor-3",
                                         .session = 7,
                                         .spec_hash = 0,
                                         .num_beams = 720,
                                         .num_streams = 16,
                                         .software = ""}));
}

TEST(CompatibilityTest, NewFieldsInsideListsArePassedOver) {
  newer::StatusReply reply;
  newer::RoleStatus* const role = reply.add_roles();
  role->mutable_report()->set_role("actor");
  role->mutable_report()->set_name("a");
  (*role->mutable_report()->mutable_figures())["steps"] = 3.0;
  for (int i = 0; i < 1000; ++i) role->mutable_report()->add_spectrum(i);
  role->set_age_s(0.5);
  role->set_address("10.0.0.1");
  reply.mutable_camera()->set_width(1);
  const auto decoded =
      Decode(Bytes(FrameByHand(1, 255, kStatusReply, reply.SerializeAsString())), {});
  ASSERT_TRUE(decoded) << decoded.failure().text;
  EXPECT_EQ(Print(*decoded), "StatusReply [[[actor a {\"steps\": 3} {}] 0.5 false] 0]");
}

TEST(CompatibilityTest, MessagesOfANewerMinorVersionAreRefusedAndNothingElseHappens) {
  newer::Weather weather;
  weather.set_temperature_k(293.0);
  const auto refused =
      Decode(Bytes(FrameByHand(1, kMinorVersion + 1, kWeather, weather.SerializeAsString())), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.failure().code, RefusalCode::kUnknownMessage);
  EXPECT_THAT(refused.failure().text, HasSubstr("message 15 of protocol 1.1"));
  // A damaged one is damaged, not new.
  std::string damaged = FrameByHand(1, 1, kWeather, weather.SerializeAsString());
  damaged.back() = static_cast<char>(damaged.back() + 1);
  EXPECT_EQ(Decode(Bytes(damaged), {}).failure().code, RefusalCode::kBadMessage);
}

TEST(CompatibilityTest, ANewerPeerReadsWhatThisOneSends) {
  const std::string frame = Encode(Examples().front().header, {});
  newer::Hello hello;
  ASSERT_TRUE(hello.ParseFromString(frame.substr(kPrefixBytes)));
  EXPECT_EQ(hello.role(), "actor");
  EXPECT_EQ(hello.name(), "actor-3");
  EXPECT_EQ(hello.session(), 7u);
  EXPECT_EQ(hello.spec_hash(), 0x123456789abcdef0u);
  EXPECT_EQ(hello.num_beams(), 720u);
  EXPECT_EQ(hello.num_streams(), 16u);
  EXPECT_EQ(hello.cameras_size(), 0);
  EXPECT_EQ(hello.shard(), 0u);
  EXPECT_EQ(hello.offset(), 0);
}

// What a version before this one would send, had it had fewer fields: they are 0, and what has no
// use at 0 is refused by name, not taken for another.
TEST(CompatibilityTest, FieldsThatAnOlderPeerDoesNotHaveAreZero) {
  // role = 1: "learner", name = 2: "l".
  const std::string hello = "\x0a\x07learner\x12\x01l";
  const auto decoded = Decode(Bytes(FrameByHand(1, 0, kHello, hello)), {});
  ASSERT_TRUE(decoded) << decoded.failure().text;
  EXPECT_EQ(Print(*decoded), "Hello [learner l 0 0 0 0  {}]");
  // cursor = 1: 300, batch = 2: 128, history = 3: 4, n_step = 4: 5; no gamma, no prioritized.
  const std::string request = "\x08\xac\x02\x10\x80\x01\x18\x04\x20\x05";
  const auto sample = Decode(Bytes(FrameByHand(1, 0, kSampleRequest, request)), {});
  ASSERT_TRUE(sample) << sample.failure().text;
  EXPECT_EQ(Print(*sample), "SampleRequest [300 128 4 5 0 false 0 0 0]");
}

// Of another major version only the first six bytes mean the same: nothing after them is looked at.
TEST(CompatibilityTest, AnotherMajorVersionIsRefusedByItsNumber) {
  for (const int major : {0, 2, 255}) {
    std::string frame = FrameByHand(major, 3, kHello, NewerHello().SerializeAsString());
    const auto refused = Decode(Bytes(frame), {});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.failure().code, RefusalCode::kWrongVersion);
    EXPECT_THAT(refused.failure().text, HasSubstr("expected 1.x"));
    for (std::size_t i = 6; i < frame.size(); ++i) frame[i] = 'x';
    EXPECT_EQ(Decode(Bytes(frame), {}).failure().code, RefusalCode::kWrongVersion);
  }
}

}  // namespace
}  // namespace slalom::proto
