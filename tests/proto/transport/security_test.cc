#include "proto/transport/security.h"

#include <gmock/gmock.h>

#include <memory>
#include <string>

#include "proto/transport/endpoint.h"
#include "tests/proto/transport/service.h"
#include "tests/support/error_of.h"
#include "tests/support/scratch_directory.h"

namespace slalom::transport::test {
namespace {

using namespace std::chrono_literals;
using slalom::test::ErrorOf;
using slalom::test::ScratchDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(EndpointTest, LocalIsWhatNoOtherMachineReaches) {
  for (const char* local : {"inproc://x", "ipc:///tmp/x", "tcp://127.0.0.1:5550",
                            "tcp://127.1.2.3:1", "tcp://localhost:5550", "tcp://[::1]:5550"}) {
    EXPECT_TRUE(IsLocal(local)) << local;
  }
  for (const char* open :
       {"tcp://*:5550", "tcp://0.0.0.0:5550", "tcp://[::]:5550", "tcp://10.0.0.1:5550",
        "tcp://replay:5550", "tcp://127.0.0.1.example.org:5550", "tcp://localhost.example.org:1",
        "tcp://127.0.0.1;10.0.0.1:5550", "tcp://1270.0.0.1:1", "tcp://[::ffff:10.0.0.1]:1", "",
        "x"}) {
    EXPECT_FALSE(IsLocal(open)) << open;
  }
}

TEST(SecurityTest, PlaintextBeyondTheMachineMustBeAskedFor) {
  SecurityConfig config;
  const auto server = [&](const char* endpoint) {
    return ErrorOf([&] { MakeServerSecurity(config, Role::kReplay, endpoint); });
  };
  const auto client = [&](const char* endpoint) {
    return ErrorOf([&] { MakeClientSecurity(config, Role::kActor, Role::kReplay, endpoint); });
  };
  const auto refused =
      AllOf(HasSubstr("tcp://*:1"), HasSubstr("security.keys is empty"),
            HasSubstr("slalom keys new DIR"), HasSubstr("security.allow_plaintext = true"));
  EXPECT_THAT(server("tcp://*:1"), refused);
  EXPECT_THAT(client("tcp://*:1"), refused);
  EXPECT_EQ(server("tcp://127.0.0.1:1"), "");
  EXPECT_EQ(client("inproc://x"), "");
  config.allow_plaintext = true;
  EXPECT_EQ(server("tcp://*:1"), "");
  EXPECT_EQ(client("tcp://replay:1"), "");
  EXPECT_FALSE(MakeServerSecurity(config, Role::kReplay, "tcp://*:1").keys);
}

TEST(SecurityTest, KeysAreThoseOfTheRolesAndOnLoopbackToo) {
  const ScratchDirectory scratch;
  WriteNewKeys(scratch.path());
  SecurityConfig config;
  config.keys = scratch.path();
  const auto server = MakeServerSecurity(config, Role::kReplay, "tcp://127.0.0.1:1");
  ASSERT_TRUE(server.keys);
  EXPECT_EQ(server.allowed, LoadAllowList(scratch.path()));
  const auto client = MakeClientSecurity(config, Role::kActor, Role::kReplay, "tcp://127.0.0.1:1");
  ASSERT_TRUE(client.keys);
  EXPECT_EQ(client.server_key, server.keys->public_key);
  EXPECT_EQ(server.allowed.at(client.keys->public_key), Role::kActor);
  EXPECT_FALSE(MakeServerSecurity(config, Role::kReplay, "inproc://x").keys);
  config.keys = scratch.path() / "none";
  EXPECT_THAT(ErrorOf([&] { MakeServerSecurity(config, Role::kReplay, "tcp://127.0.0.1:1"); }),
              HasSubstr("none/replay.key"));
}

/// A client of a CURVE service that must not get in.
class IntruderTest : public ::testing::Test {
 protected:
  void ExpectRejected(Client& client) {
    Until([&] {
      EXPECT_FALSE(service_.server().Receive(1ms));
      EXPECT_FALSE(client.Send(Text("let me in")));
      return service_.server().connections().rejected > 0 && client.trouble() != "" &&
             client.trouble() != "not connected yet";
    });
    EXPECT_EQ(client.connections(), 0);
    const auto honest = service_.NewClient();
    SendTo(*honest, Text("hello"));
    EXPECT_EQ(HeaderOf(ReceiveFrom(service_.server()).message), "hello");
  }

  ClientOptions Options(ClientSecurity security) {
    ClientOptions options;
    options.endpoint = service_.server().endpoint();
    options.security = std::move(security);
    return options;
  }

  Service service_{Wire::kCurve};
  Context context_;
};

TEST_F(IntruderTest, AKeyThatIsNotOnTheListIsRefusedAndSaidSo) {
  Client client(context_, Options({NewKeyPair(), service_.keys(Role::kReplay).public_key}));
  ExpectRejected(client);
  EXPECT_THAT(client.trouble(), HasSubstr("not on the server's allow list"));
}

TEST_F(IntruderTest, WithoutKeysNobodyConnects) {
  Client client(context_, Options({}));
  ExpectRejected(client);
}

TEST_F(IntruderTest, AServerOfAnotherKeyIsNotTalkedTo) {
  Client client(context_, Options({service_.keys(Role::kActor), NewKeyPair().public_key}));
  ExpectRejected(client);
}

TEST_F(IntruderTest, APublicKeyWithoutItsSecretDoesNotDo) {
  KeyPair stolen = service_.keys(Role::kLearner);
  stolen.secret_key = NewKeyPair().secret_key;
  Client client(context_, Options({stolen, service_.keys(Role::kReplay).public_key}));
  ExpectRejected(client);
}

TEST_F(IntruderTest, AServerInPlaintextTakesNoKeys) {
  Service plaintext(Wire::kPlaintext);
  ClientOptions options = Options({service_.keys(Role::kActor), NewKeyPair().public_key});
  options.endpoint = plaintext.server().endpoint();
  Client client(context_, options);
  Until([&] {
    EXPECT_FALSE(plaintext.server().Receive(1ms));
    EXPECT_FALSE(client.Send(Text("let me in")));
    return plaintext.server().connections().rejected > 0;
  });
  EXPECT_EQ(client.connections(), 0);
}

// An operator adds the key and starts the server again; the actor, which runs on, then gets in.
TEST_F(IntruderTest, WhoWasRefusedTriesAgain) {
  const KeyPair mine = NewKeyPair();
  const KeyPair server_keys = NewKeyPair();
  Context server_context;
  ServerOptions options;
  options.endpoint = "tcp://127.0.0.1:*";
  options.security = {server_keys, {{NewKeyPair().public_key, Role::kActor}}};
  auto server = std::make_unique<Server>(server_context, options);
  options.endpoint = server->endpoint();
  ClientOptions client_options = Options({mine, server_keys.public_key});
  client_options.endpoint = server->endpoint();
  Client client(context_, client_options);
  Until([&] {
    EXPECT_FALSE(server->Receive(1ms));
    client.Receive(1ms);
    return client.trouble().find("allow list") != std::string::npos;
  });
  server.reset();
  options.security.allowed[mine.public_key] = Role::kActor;
  server = std::make_unique<Server>(server_context, options);
  SendTo(client, Text("hello"));
  EXPECT_EQ(ReceiveFrom(*server).role, Role::kActor);
}

}  // namespace
}  // namespace slalom::transport::test
