#pragma once

#include <pybind11/pybind11.h>

namespace slalom::python {

/// Adds `evaluate` and the class of its results to the module. Requires: it has the class of
/// policies.
void DefineEvaluation(pybind11::module_& module);

}  // namespace slalom::python
