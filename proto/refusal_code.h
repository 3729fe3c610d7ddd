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

/// The only list of codes, which the compiler keeps complete. "other" stands for the codes of a
/// newer minor version.
constexpr RefusalDescription Describe(RefusalCode code) {
  switch (code) {
    case RefusalCode::kBadMessage:
      return {"bad_message", "cut short, damaged, or a value out of bounds"};
    case RefusalCode::kWrongVersion:
      return {"wrong_version", "another major version of the protocol"};
    case RefusalCode::kUnknownMessage:
      return {"unknown_message", "of a newer minor version"};
    case RefusalCode::kNotAllowed:
      return {"not_allowed", "the sender's role may not send it"};
    case RefusalCode::kWrongSpec:
      return {"wrong_spec", "the run, observations or actions are not those of this service"};
    case RefusalCode::kNoSession:
      return {"no_session", "insert before hello, or of a session that is not open: say hello"};
    case RefusalCode::kOutOfOrder:
      return {"out_of_order", "a chunk is missing before this one: say hello"};
    case RefusalCode::kOverWindow:
      return {"over_window", "more unacknowledged payload than the window"};
    case RefusalCode::kTooFast:
      return {"too_fast", "more messages than the rate bound"};
    case RefusalCode::kNotReady:
      return {"not_ready", "not now"};
    case RefusalCode::kReplaced:
      return {"replaced", "hello of a session that a newer one replaced, whose number is `about`"};
  }
  return {"other", ""};
}
constexpr std::string_view ToString(RefusalCode code) { return Describe(code).name; }

/// All codes, in the order of their numbers, which are consecutive: an array that `Describe` fills.
inline constexpr auto kRefusalCodes = [] {
  constexpr std::uint32_t kEnd = [] {
    std::uint32_t number = 1;
    while (ToString(static_cast<RefusalCode>(number)) != "other") ++number;
    return number;
  }();
  std::array<RefusalCode, kEnd - 1> codes{};
  for (std::uint32_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<RefusalCode>(i + 1);
  return codes;
}();

}  // namespace slalom::proto
