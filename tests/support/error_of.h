#pragma once

#include <string>

#include "base/error.h"

namespace slalom::test {

/// What the error of `call` says; empty: there is none.
template <class Call>
std::string ErrorOf(const Call& call) {
  try {
    call();
  } catch (const base::Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace slalom::test
