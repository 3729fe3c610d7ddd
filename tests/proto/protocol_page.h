#pragma once

#include <string>
#include <vector>

namespace slalom::proto {

/// A field as proto/slalom.proto describes it, in the words of docs/protocol.md.
struct FieldRow {
  int number = 0;
  std::string type;  ///< "uint32", "map of string to double", "repeated `RoleStatus`".
  std::string meaning;
  std::string bounds;  ///< Empty: none.
};

struct MessageRows {
  std::string name;
  std::vector<FieldRow> fields;
};

/// All messages in the order of their numbers, then the parts of messages.
std::vector<MessageRows> AllMessages();

/// Returns docs/protocol.md with the tables of fields and of refusal codes as proto/ has
/// them, and everything else as it is. Throws `std::runtime_error` if a table has no place:
/// the heading of a message, or the line that names what a table lists.
std::string WithTables(const std::string& page);

}  // namespace slalom::proto
