#pragma once

namespace slalom::base {

/// Raises the number of files and connections that this process may have open as far as the system
/// lets it without asking, but not beyond 65,536: some programs close every number up to the limit
/// that they inherit. A limit that cannot be raised stays. Call it before any thread starts.
void RaiseDescriptorLimit();

}  // namespace slalom::base
