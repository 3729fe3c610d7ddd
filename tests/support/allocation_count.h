#pragma once

namespace slalom::test {

/// Calls of operator new since the program started, by any thread. A test that links
/// allocation_count.cc can thus show that a hot loop allocates nothing.
long NumAllocations();
/// Bytes that they asked for.
long NumAllocatedBytes();

}  // namespace slalom::test
