// What describes a message outside proto/slalom.proto says the same.

#include "tests/proto/protocol_page.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>

#include "base/file.h"
#include "proto/messages.h"
#include "proto/slalom.pb.h"

namespace slalom::proto {
namespace {

const std::filesystem::path kSource = SLALOM_SOURCE_DIR;

TEST(ProtocolPageTest, EveryMessageAndFieldIsExplained) {
  const std::string proto = base::ReadFile(kSource / "proto/slalom.proto");
  for (const MessageRows& message : AllMessages()) {
    const std::size_t begin = proto.find(fmt::format("\nmessage {} {{", message.name));
    ASSERT_NE(begin, std::string::npos) << message.name;
    EXPECT_EQ(proto.compare(proto.rfind('\n', begin - 1) + 1, 3, "// "), 0) << message.name;
    for (const FieldRow& field : message.fields) {
      EXPECT_FALSE(field.meaning.empty()) << message.name << ' ' << field.number;
    }
  }
}

TEST(ProtocolPageTest, TheConstantsAreThoseOfTheProtoFile) {
  const auto max_of = [](const google::protobuf::Descriptor* type, const char* field) {
    return type->FindFieldByName(field)->options().GetExtension(wire::max);
  };
  EXPECT_EQ(max_of(wire::Hello::descriptor(), "num_streams"), kMaxStreams);
  EXPECT_EQ(max_of(wire::Report::descriptor(), "figures"), kMaxFigures);
  EXPECT_EQ(max_of(wire::StatusReply::descriptor(), "roles"), kMaxRoles);
}

TEST(ProtocolPageTest, ThePageIsFresh) {
  const std::string page = base::ReadFile(kSource / "docs/protocol.md");
  EXPECT_EQ(WithTables(page), page)
      << "docs/protocol.md is stale: build/BUILD/tests/proto/write_protocol_page docs/protocol.md";
}

TEST(ProtocolPageTest, ThePageNumbersTheMessagesAsTheyAreOnTheWire) {
  const std::string page = base::ReadFile(kSource / "docs/protocol.md");
  const std::vector<MessageRows> messages = AllMessages();
  for (std::size_t i = 0; i < std::variant_size_v<Header>; ++i) {
    EXPECT_TRUE(page.find(fmt::format("\n| {} | `{}` |", i + 1, messages[i].name)) !=
                std::string::npos)
        << messages[i].name;
  }
}

TEST(ProtocolPageTest, AStaleTableIsReplacedAndNothingElse) {
  const std::string page = base::ReadFile(kSource / "docs/protocol.md");
  std::string stale = page;
  const auto row = stale.find("| 6 | bool | prioritized | |\n");
  ASSERT_NE(row, std::string::npos);
  stale.replace(row, 5, "| 8 |");
  ASSERT_NE(stale, page);
  EXPECT_TRUE(WithTables(stale) == WithTables(page));
  EXPECT_THROW((void)WithTables("# Protocol\n"), std::runtime_error);
}

}  // namespace
}  // namespace slalom::proto
