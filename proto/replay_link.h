#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "proto/messages.h"
#include "proto/transport/client.h"

namespace slalom::service {

/// A role's connection to the replay server. It says hello on every new connection and after a long
/// silence of the server, drops a connection that does not answer, and sends the role's reports.
/// Confined to one thread.
class ReplayLink {
 public:
  /// A session of 0 stands for the time of this call, so that it rises with each start.
  ReplayLink(transport::Context& context, const transport::ClientOptions& replay,
             proto::Hello hello);

  /// Changes the hello, and sends it at once if there is a connection.
  void SetHello(proto::Hello hello);
  const proto::Hello& hello() const { return hello_; }
  /// Sends the hello again, for example after a refusal. `welcomed` then refers to the answer to
  /// this one.
  void SayHello();

  struct Received {
    proto::Header header;
    transport::Frame payload;
  };
  /// Returns the next message for the role: a welcome, an acknowledgement, a sample, a status, or a
  /// refusal. Returns nothing if none came within `timeout`, or if the link handled it itself.
  /// Throws `base::Error` if the server refuses this process for good (key, version, spec, or
  /// another process of this role and name that started later; an actor is told that by a refusal).
  ///
  /// The link ignores the refusal of a message that was sent before the hello on a new connection,
  /// logs that of a hello once a minute, and tries again. After any other refusal it says hello
  /// again; the role then sends again from the place that the welcome names. It leaves only
  /// `kReplaced`, which answers an actor's hello, to the role.
  std::optional<Received> Receive(std::chrono::milliseconds timeout);

  /// Sends a message. Returns false if that is impossible now (no connection, or a full queue).
  [[nodiscard]] bool Send(const proto::Header& header, transport::Frame payload = {});

  /// Sends the `proto::Report` that `make` returns if the last one was at least a second ago.
  template <class MakeReport>
  void ReportEverySecond(const MakeReport& make) {
    if (report_due()) SendReport(make());
  }

  /// Why there is no welcome, in words: the last refusal, or the connection's trouble. Empty if the
  /// link is welcomed or there was no answer yet.
  std::string trouble();

  /// Whether the server has answered the last hello.
  bool welcomed() const { return welcomed_; }
  /// Number of welcomes so far on new connections or after `SayHello`. When it changes, answers to
  /// earlier requests may never come.
  int num_welcomes() const { return num_welcomes_; }
  int connections() { return client_.connections(); }
  const std::string& endpoint() const { return endpoint_; }
  transport::Client& client() { return client_; }

 private:
  void NoteRefusal(const proto::Refusal& refusal);
  /// Notices new connections and silence.
  void Watch();
  bool report_due() const;
  void SendReport(const proto::Report& report);

  transport::Client client_;
  const std::string endpoint_;
  proto::Hello hello_;
  bool welcomed_ = false;
  bool is_new_ = true;  // The next welcome counts.
  int num_welcomes_ = 0;
  bool said_hello_ = false;
  int connections_ = 0;
  int unanswered_ = 0;
  std::optional<std::chrono::steady_clock::time_point> hello_at_;  // The last one.
  std::chrono::steady_clock::time_point heard_at_;                 // Since the last connection.
  std::optional<std::chrono::steady_clock::time_point> reported_at_;
  std::string refusal_;  // Of the last hello.
  std::optional<std::chrono::steady_clock::time_point> said_refusal_at_;
};

}  // namespace slalom::service
