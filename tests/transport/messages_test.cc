#include <gmock/gmock.h>

#include "transport/client.h"
#include "transport/server.h"

namespace slalom::transport {
namespace {

using namespace std::chrono_literals;

TEST(MessagesTest, AMessageGoesThereAndBack) {
  for (const bool has_keys : {false, true}) {
    Context server_context;
    Context client_context;
    const KeyPair server_keys = NewKeyPair();
    const KeyPair client_keys = NewKeyPair();
    ServerOptions server_options{.endpoint = "tcp://127.0.0.1:*"};
    if (has_keys) {
      server_options.security = {server_keys, {{client_keys.public_key, Role::kActor}}};
    }
    Server server(server_context, server_options);
    ClientOptions client_options{.endpoint = server.endpoint()};
    if (has_keys) client_options.security = {client_keys, server_keys.public_key};
    Client client(client_context, client_options);
    while (!client.Send({Frame::Copy("hello"), Frame::Copy("x")})) {
      EXPECT_FALSE(client.Receive(10ms));
    }
    const auto received = server.Receive(5s);
    ASSERT_TRUE(received);
    EXPECT_EQ(received->role, has_keys ? std::optional(Role::kActor) : std::nullopt);
    EXPECT_EQ(server.Send(received->peer, {Frame::Copy("yes"), Frame()}), Server::Sent::kYes);
    EXPECT_TRUE(client.Receive(5s));
    EXPECT_EQ(client.connections(), 1);
    EXPECT_EQ(server.rejected_connections(), 0);
  }
}

}  // namespace
}  // namespace slalom::transport
