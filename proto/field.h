#pragma once

#include <cstddef>
#include <string_view>
#include <utility>

/// Vocabulary of a message's list of fields. A visitor of the list is called with
///
///     (int number, std::string_view name, T& member, access, bound, std::string_view meaning)
///
/// with one of the types below as `bound` and a `FieldAccess` as `access`.

namespace slalom::proto {

struct Any {};

/// A bound that other fields or the sender's role decide: proto/bounds.cc or the receiver checks
/// it. `text` describes it for people.
struct Related {
  std::string_view text;
};

/// From `low` to `high`. NaN is in no interval.
struct In {
  double low;
  double high;
};

/// `low` or more, and finite.
struct AtLeast {
  int low;
};

struct Finite {};

/// A name (`base::IsName`).
struct Name {};

/// Printable ASCII of at most `kMaxTextBytes`. Text to be sent is made to fit.
struct Text {};

/// Largest number of entries of a list or a map. Keys are names, texts in a map are `Text`.
struct AtMost {
  std::size_t size;
};

/// How to reach a field in the class that protoc generated, for proto/conversion.cc alone: the
/// lambdas are templates, so nobody else needs that class.
template <class Get, class Set, class Mutable>
struct FieldAccess {
  Get get;           ///< From the wire's message to the value.
  Set set;           ///< Takes the wire's message and a value.
  Mutable mutable_;  ///< From the wire's message to a pointer to a list, map or message.
};
template <class Get, class Set, class Mutable>
FieldAccess(Get, Set, Mutable) -> FieldAccess<Get, Set, Mutable>;

/// Name, member and access of a field of the message `m`: the second to fourth argument of the
/// visitor.
#define SLALOM_FIELD(field)                                                                       \
#field, m.field, ::slalom::proto::FieldAccess {                                                 \
    [](const auto& wire) -> decltype(auto) { return wire.field(); },                              \
        [](auto& wire, auto&& value) { wire.set_##field(std::forward<decltype(value)>(value)); }, \
        [](auto& wire) { return wire.mutable_##field(); }                                         \
  }

/// Whether a type is a message or a part of one, with a list of fields.
template <class T>
concept HasFields = requires {
  T::kName;
};

}  // namespace slalom::proto
