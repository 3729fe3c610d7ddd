#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "proto/messages.h"
#include "transport/client.h"

namespace slalom::service {

/// A role's connection to the replay server: says hello whenever the connection was made anew and
/// when the server was silent for long, gives up a connection that does not answer, and sends the
/// role's reports. Confined to one thread.
class ReplayLink {
 public:
  ReplayLink(transport::Context& context, const transport::ClientOptions& replay,
             proto::Hello hello);

  /// Changes what is said, and says it at once where there is a connection.
  void SetHello(proto::Hello hello);
  const proto::Hello& hello() const { return hello_; }
  /// Says it again, as after a refusal; a later `welcomed` is then about the answer to this one.
  void SayHello();

  struct Received {
    proto::Header header;
    transport::Frame payload;
  };
  /// The next message that is for the role: a welcome, an acknowledgement, a sample, a status, or a
  /// refusal. None within `timeout`, or what came is for nobody. Throws `base::Error` where the
  /// server refuses this process for good (key, version, spec).
  ///
  /// A refusal of what was sent before the hello on a new connection is passed over. After any
  /// other the link has logged it and said hello again, upon which the role sends anew from where
  /// the welcome says; but `kReplaced`, which answers a hello, is the role's to deal with.
  std::optional<Received> Receive(std::chrono::milliseconds timeout);

  /// False: not now (no connection, or the queue is full).
  [[nodiscard]] bool Send(const proto::Header& header, transport::Frame payload = {});

  /// Sends what `make` returns, a `proto::Report`, if the last one was a second ago.
  template <class MakeReport>
  void ReportEverySecond(const MakeReport& make) {
    if (report_due()) SendReport(make());
  }

  /// The server answered the last hello.
  bool welcomed() const { return welcomed_; }
  /// Welcomes on new connections or after `SayHello`, so far: when it changes, what was asked for
  /// before may not be on its way.
  int num_welcomes() const { return num_welcomes_; }
  int connections() { return client_.connections(); }
  const std::string& endpoint() const { return endpoint_; }
  transport::Client& client() { return client_; }

 private:
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
  std::chrono::steady_clock::time_point hello_at_;
  std::chrono::steady_clock::time_point heard_at_;
  std::chrono::steady_clock::time_point reported_at_;
};

}  // namespace slalom::service
