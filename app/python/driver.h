#pragma once

#include <pybind11/pybind11.h>

namespace slalom::python {

/// Adds the class of drivers to the module.
void DefineDriver(pybind11::module_& module);

}  // namespace slalom::python
