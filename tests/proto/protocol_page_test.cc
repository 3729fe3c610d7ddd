// What describes a message outside its list of fields says the same: proto/slalom.proto has the
// same fields, and docs/protocol.md the same tables.

#include "tests/proto/protocol_page.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <stdexcept>

#include "base/file.h"

namespace slalom::proto {
namespace {

const std::filesystem::path kSource = SLALOM_SOURCE_DIR;

/// The fields in proto/slalom.proto, one line each: "Hello.role = 1: string".
std::vector<std::string> FieldsOfProtoFile() {
  std::vector<std::string> fields;
  std::istringstream lines(base::ReadFile(kSource / "proto/slalom.proto"));
  const std::regex begin(R"(message (\w+) \{.*)");
  const std::regex field(R"( *(.*\S) +(\w+) = (\d+);)");
  std::smatch match;
  std::string message;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, begin)) message = match[1];
    if (std::regex_match(line, match, field)) {
      fields.push_back(
          fmt::format("{}.{} = {}: {}", message, match[2].str(), match[3].str(), match[1].str()));
    }
  }
  std::ranges::sort(fields);
  return fields;
}

TEST(ProtocolPageTest, TheListsHaveTheFieldsOfTheProtoFile) {
  std::vector<std::string> fields;
  for (const MessageRows& message : AllMessages()) {
    for (const FieldRow& row : message.fields) {
      std::string type =
          std::regex_replace(row.type, std::regex("map of string to (.*)"), "map<string, $1>");
      std::erase(type, '`');
      fields.push_back(fmt::format("{}.{} = {}: {}", message.name, row.name, row.number, type));
    }
  }
  std::ranges::sort(fields);
  EXPECT_THAT(fields, testing::ContainerEq(FieldsOfProtoFile()));
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
