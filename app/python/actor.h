#pragma once

#include <pybind11/pybind11.h>

namespace slalom::python {

/// Adds the class `Actor` to the module.
void DefineActor(pybind11::module_& module);

}  // namespace slalom::python
