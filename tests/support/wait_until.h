#pragma once

#include <thread>

namespace slalom::test {

/// Waits until `condition` holds; the test's time limit ends it otherwise.
template <class Condition>
void WaitUntil(Condition condition) {
  while (!condition()) std::this_thread::yield();
}

}  // namespace slalom::test
