#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "proto/messages.h"
#include "proto/transport/context.h"
#include "proto/transport/frame.h"
#include "proto/transport/server.h"

namespace slalom::actor {

/// A learner that gives every reader its newest policy, once, until it goes out of scope. The first
/// is version 7.
class OnePolicy {
 public:
  OnePolicy()
      : server_(context_, {.endpoint = "tcp://127.0.0.1:*"}),
        thread_([this](const std::stop_token& stop) { Serve(stop); }) {}

  const std::string& endpoint() const { return server_.endpoint(); }

  void Publish(std::int64_t version, std::string policy) {
    const std::lock_guard lock(mutex_);
    version_ = version;
    policy_ = std::move(policy);
  }

 private:
  struct Reader {
    transport::PeerId peer;
    std::int64_t held;
  };

  void Serve(const std::stop_token& stop) {
    std::vector<Reader> waiting;
    while (!stop.stop_requested()) {
      if (auto received = server_.Receive(std::chrono::milliseconds(20))) {
        const auto header =
            proto::Decode(received->message.header.bytes(), received->message.payload.bytes());
        const auto* request = header ? std::get_if<proto::SnapshotRequest>(&*header) : nullptr;
        if (request != nullptr) waiting.push_back({received->peer, request->held_version});
      }
      std::erase_if(waiting, [this](const Reader& reader) { return Answer(reader); });
    }
  }

  /// Whether there was something new to answer with.
  bool Answer(const Reader& reader) {
    const std::lock_guard lock(mutex_);
    if (reader.held == version_) return false;
    const auto policy = transport::Frame::Copy(policy_);
    proto::Snapshot snapshot;
    snapshot.version = version_;
    const auto encoded = proto::Encode(snapshot, policy.bytes());
    static_cast<void>(server_.Send(reader.peer, {transport::Frame::Copy(encoded), policy.Share()}));
    return true;
  }

  std::mutex mutex_;
  std::int64_t version_ = 7;
  std::string policy_ = "a policy";
  transport::Context context_;
  transport::Server server_;
  std::jthread thread_;
};

}  // namespace slalom::actor
