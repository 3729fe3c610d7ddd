#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "proto/messages.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"
#include "replay/service/reply_sender.h"

namespace slalom::replay {

/// A message as it came.
struct Reply {
  proto::Header header;
  transport::Frame payload;

  template <class T>
  const T* as() const {
    return std::get_if<T>(&header);
  }
};

/// The other end of a connection to a replay server.
class TestPeer {
 public:
  TestPeer(transport::Context& context, const std::string& endpoint,
           transport::ClientSecurity security = {})
      : client_(context, {.endpoint = endpoint, .security = std::move(security)}) {}

  void Send(const proto::Header& header, transport::Frame payload = {}) {
    Send(MakeMessage(header, std::move(payload)));
  }
  /// Whatever the bytes are.
  void Send(transport::Message message) {
    while (!client_.Send(std::move(message))) {
      transport::Client::WaitForAny({&client_}, std::chrono::milliseconds(5));
    }
  }

  /// The next message, waited for until the test's time limit ends it.
  std::optional<Reply> Receive() {
    std::optional<transport::Message> message;
    while (!message) message = client_.Receive(std::chrono::hours(1));
    auto header = proto::Decode(message->header.bytes(), message->payload.bytes());
    EXPECT_TRUE(header.ok());
    if (!header) return std::nullopt;
    return Reply{std::move(*header), std::move(message->payload)};
  }

  /// The next message, which is of this kind.
  template <class T>
  std::optional<T> Expect(transport::Frame* payload = nullptr) {
    auto reply = Receive();
    if (!reply) return std::nullopt;
    if (reply->as<T>() == nullptr) {
      const auto* refusal = reply->as<proto::Refusal>();
      ADD_FAILURE() << "found " << proto::NameOf(reply->header) << " "
                    << (refusal ? refusal->text : "");
      return std::nullopt;
    }
    if (payload != nullptr) *payload = std::move(reply->payload);
    return *reply->as<T>();
  }

  transport::Client& client() { return client_; }

 private:
  transport::Client client_;
};

/// The next message refuses what was sent before.
inline void ExpectRefused(TestPeer& peer, proto::RefusalCode code) {
  const auto refusal = peer.Expect<proto::Refusal>();
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, code) << refusal->text;
}

inline proto::Report ReportOf(const std::string& role, const std::string& name) {
  return {.role = role, .name = name, .figures = {{"x", 1.0}}, .facts = {}};
}

/// The names of a role that the status tells.
inline std::vector<std::string> NamesOf(TestPeer& peer, const std::string& role) {
  peer.Send(proto::StatusRequest{});
  std::vector<std::string> names;
  const auto reply = peer.Expect<proto::StatusReply>();
  if (!reply) return names;
  for (const auto& entry : reply->roles) {
    if (entry.report.role == role) names.push_back(entry.report.name);
  }
  return names;
}

}  // namespace slalom::replay
