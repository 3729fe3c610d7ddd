#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>

#include "proto/transport/client.h"
#include "proto/transport/server.h"

/// A server and clients to try the contract of `proto/transport/` on, over each kind of connection.

namespace slalom::transport::test {

enum class Wire { kInproc, kPlaintext, kCurve };
void PrintTo(Wire wire, std::ostream* out);

/// Servers and clients of one kind in one thread. Over tcp each client has a context of its own, as
/// in a process of its own.
class Service {
 public:
  explicit Service(Wire wire, ServerOptions options = {});

  Server& server() { return *server_; }
  void StopServer() { server_.reset(); }
  /// At the endpoint where the first one was.
  void StartServer();

  /// A client of its own context with the keys of `role`.
  std::unique_ptr<Client> NewClient(Role role = Role::kActor, ClientOptions options = {});

  /// Keys of a role that the server allows.
  const KeyPair& keys(Role role) const { return keys_.at(role); }

 private:
  const Wire wire_;
  std::map<Role, KeyPair> keys_;
  ServerOptions options_;
  std::vector<std::unique_ptr<Context>> contexts_;  // The first is the server's.
  std::unique_ptr<Server> server_;
};

/// Longer than the test's time limit, which ends a test that waits in vain.
inline constexpr std::chrono::hours kPatience{1};

Server::Received ReceiveFrom(Server& server);
Message ReceiveFrom(Client& client);
/// Sends as soon as there is a connection with room.
void SendTo(Client& client, Message message);
/// Calls `step`, which waits a little at most, until it says true.
void Until(const std::function<bool()>& step);

Message Text(std::string_view header, std::string_view payload = "");
std::string HeaderOf(const Message& message);
std::string PayloadOf(const Message& message);

/// `size` bytes that differ from each other, and for each `seed`.
Frame Pattern(std::size_t size, unsigned seed);

}  // namespace slalom::transport::test
