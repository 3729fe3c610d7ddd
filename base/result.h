#pragma once

#include <string>
#include <utility>
#include <variant>

#include "base/check.h"

namespace slalom::base {

/// The reason why an operation that is expected to fail at times has failed, in words for a log.
struct Failure {
  std::string text;
};

/// A value, or the reason why there is none. For failures that are expected while running, such as
/// a bad message or a closed peer: exceptions for them would be control flow. A value type.
template <class T, class E = Failure>
class [[nodiscard]] Result {
 public:
  Result(T value) : held_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit
  Result(E failure) : held_(std::in_place_index<1>, std::move(failure)) {}  // NOLINT: implicit

  bool ok() const { return held_.index() == 0; }
  explicit operator bool() const { return ok(); }

  /// Requires: ok().
  T& value() {
    SLALOM_CHECK(ok());
    return std::get<0>(held_);
  }
  const T& value() const {
    SLALOM_CHECK(ok());
    return std::get<0>(held_);
  }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  /// Requires: !ok().
  const E& failure() const {
    SLALOM_CHECK(!ok());
    return std::get<1>(held_);
  }

 private:
  std::variant<T, E> held_;
};

}  // namespace slalom::base
