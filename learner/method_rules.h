#pragma once

#include "learner/method.h"

namespace slalom::learner {

/// Throws `base::Error` that names the key if the sections of a method contradict each other. Keys
/// that nothing reads are another rule (`config::RequireRead`).
void RequireConsistent(const MethodConfig& method);

}  // namespace slalom::learner
