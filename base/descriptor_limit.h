#pragma once

namespace slalom::base {

/// Raises this process's limit of open files and connections to the hard limit, but not beyond
/// 65,536, because some programs close every number up to the limit that they inherit. A limit that
/// cannot be raised stays. Call it before any thread starts.
void RaiseDescriptorLimit();

/// Returns how many files and connections this process may have open at once.
int DescriptorLimit();

}  // namespace slalom::base
