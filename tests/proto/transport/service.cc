#include "tests/proto/transport/service.h"

#include <utility>

namespace slalom::transport::test {

using namespace std::chrono_literals;

void PrintTo(Wire wire, std::ostream* out) {
  *out << (wire == Wire::kInproc ? "inproc" : wire == Wire::kPlaintext ? "plaintext" : "curve");
}

Service::Service(Wire wire, ServerOptions options) : wire_(wire), options_(std::move(options)) {
  for (const Role role : kRoles) keys_[role] = NewKeyPair();
  options_.endpoint = wire == Wire::kInproc ? "inproc://service" : "tcp://127.0.0.1:*";
  if (wire == Wire::kCurve) {
    AllowList allowed;
    for (const auto& [role, keys] : keys_) allowed[keys.public_key] = role;
    options_.security = {keys_.at(Role::kReplay), allowed};
  }
  contexts_.push_back(std::make_unique<Context>());
  StartServer();
}

void Service::StartServer() {
  server_ = std::make_unique<Server>(*contexts_.front(), options_);
  options_.endpoint = server_->endpoint();
}

std::unique_ptr<Client> Service::NewClient(Role role, ClientOptions options) {
  if (wire_ != Wire::kInproc) contexts_.push_back(std::make_unique<Context>());
  options.endpoint = options_.endpoint;
  if (wire_ == Wire::kCurve) {
    options.security = {keys_.at(role), keys_.at(Role::kReplay).public_key};
  }
  return std::make_unique<Client>(*contexts_.back(), options);
}

void Until(const std::function<bool()>& step) {
  while (!step()) {
  }
}

Server::Received ReceiveFrom(Server& server) {
  std::optional<Server::Received> received;
  Until([&] { return (received = server.Receive(100ms)).has_value(); });
  return std::move(*received);
}

Message ReceiveFrom(Client& client) {
  std::optional<Message> received;
  Until([&] { return (received = client.Receive(100ms)).has_value(); });
  return std::move(*received);
}

void SendTo(Client& client, Message message) {
  Until([&] {
    if (client.Send(std::move(message))) return true;
    Client::WaitForAny({&client}, 1ms);
    return false;
  });
}

Message Text(std::string_view header, std::string_view payload) {
  return {Frame::Copy(header), Frame::Copy(payload)};
}

namespace {

std::string TextOf(const Frame& frame) {
  return {reinterpret_cast<const char*>(frame.bytes().data()), frame.size()};
}

}  // namespace

std::string HeaderOf(const Message& message) { return TextOf(message.header); }
std::string PayloadOf(const Message& message) { return TextOf(message.payload); }

Frame Pattern(std::size_t size, unsigned seed) {
  Frame frame(size);
  unsigned state = seed * 2654435761u + 1;
  for (std::byte& byte : frame.mutable_bytes()) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<std::byte>(state >> 24);
  }
  return frame;
}

}  // namespace slalom::transport::test
