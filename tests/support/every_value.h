#pragma once

#include <vector>

#include "base/config_field.h"

namespace slalom::test {

/// All values of an enum with names, so that a new one is tested like any other.
template <base::NamedEnum E>
std::vector<E> EveryValue() {
  std::vector<E> values;
  for (std::size_t i = 0; i < EnumNames(E{}).choices.size(); ++i) {
    values.push_back(static_cast<E>(i));
  }
  return values;
}

}  // namespace slalom::test
