#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace slalom::proto {

/// Reasons for refusing a message. The numbers are part of the protocol; `Describe` explains them.
enum class RefusalCode : std::uint32_t {
  kBadMessage = 1,
  kWrongVersion = 2,
  kUnknownMessage = 3,
  kNotAllowed = 4,
  kWrongSpec = 5,
  kNoSession = 6,
  kOutOfOrder = 7,
  kOverWindow = 8,
  kTooFast = 9,
  kNotReady = 10,
  kReplaced = 11,
};

struct RefusalDescription {
  std::string_view name;  ///< Name in logs and in labels of metrics.
  std::string_view meaning;
};

/// The descriptions of the codes, in the order of their numbers, which count from 1.
inline constexpr auto kRefusals = std::to_array<RefusalDescription>({
    {"bad_message", "cut short, damaged, or a value out of bounds"},
    {"wrong_version", "another major version of the protocol"},
    {"unknown_message", "of a newer minor version"},
    {"not_allowed", "the sender's role may not send it"},
    {"wrong_spec", "the run, observations or actions are not those of this service"},
    {"no_session", "insert before hello, or of a session that is not open: say hello"},
    {"out_of_order", "a chunk is missing before this one: say hello"},
    {"over_window", "more unacknowledged payload than the window"},
    {"too_fast", "more messages than the rate bound"},
    {"not_ready", "not now"},
    {"replaced", "hello of a session that a newer one replaced, whose number is `about`"},
});
static_assert(kRefusals.size() == static_cast<std::size_t>(RefusalCode::kReplaced));

/// "other" stands for the codes of a newer minor version.
constexpr RefusalDescription Describe(RefusalCode code) {
  const auto place = static_cast<std::size_t>(code) - 1;
  return place < kRefusals.size() ? kRefusals[place] : RefusalDescription{"other", ""};
}
constexpr std::string_view ToString(RefusalCode code) { return Describe(code).name; }

/// All codes, in the order of their numbers.
inline constexpr auto kRefusalCodes = [] {
  std::array<RefusalCode, kRefusals.size()> codes{};
  for (std::uint32_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<RefusalCode>(i + 1);
  return codes;
}();

}  // namespace slalom::proto
