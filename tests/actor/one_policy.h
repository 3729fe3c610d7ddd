#pragma once

#include <chrono>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "proto/messages.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "proto/transport/server.h"

namespace slalom::actor {

/// A learner that gives every reader one policy, once, until it goes out of scope.
class OnePolicy {
 public:
  OnePolicy()
      : server_(context_, {.endpoint = "tcp://127.0.0.1:*"}), thread_([this](auto stop) {
          while (!stop.stop_requested()) {
            auto received = server_.Receive(std::chrono::milliseconds(20));
            if (!received) continue;
            const auto header =
                proto::Decode(received->message.header.bytes(), received->message.payload.bytes());
            const auto* request = header ? std::get_if<proto::SnapshotRequest>(&*header) : nullptr;
            if (request == nullptr || request->held_version == 7) continue;
            const auto policy = transport::Frame::Copy(std::string_view("a policy"));
            proto::Snapshot snapshot;
            snapshot.version = 7;
            const auto encoded = proto::Encode(snapshot, policy.bytes());
            static_cast<void>(
                server_.Send(received->peer, {transport::Frame::Copy(encoded), policy.Share()}));
          }
        }) {}

  const std::string& endpoint() const { return server_.endpoint(); }

 private:
  transport::Context context_;
  transport::Server server_;
  std::jthread thread_;
};

}  // namespace slalom::actor
