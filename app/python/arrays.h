#pragma once

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "env/action.h"

/// Arrays that come from Python.

namespace slalom::python {

namespace py = pybind11;

/// Numbers of this type in rows, converted if they come as others.
template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;

/// Throws `base::Error` that names the array and both shapes.
template <class T>
void RequireShape(const char* name, const Array<T>& array,
                  const std::vector<py::ssize_t>& expected) {
  const std::vector<py::ssize_t> found(array.shape(), array.shape() + array.ndim());
  if (found == expected) return;
  throw base::Error(fmt::format("{}: its shape is {}, expected {}", name,
                                std::string(py::str(py::tuple(py::cast(found)))),
                                std::string(py::str(py::tuple(py::cast(expected))))));
}

/// Ranges as they are stored. Throws `base::Error` if they are of another type: metres, cast to
/// centimetres, would be wrong without a word.
inline Array<std::uint16_t> RangesOf(const py::array& ranges) {
  if (!py::isinstance<py::array_t<std::uint16_t>>(ranges)) {
    throw base::Error(fmt::format("ranges: their type is {}, expected uint16, in centimetres",
                                  std::string(py::str(ranges.dtype()))));
  }
  return ranges;
}

/// [batch_size, 2] as actions. A view of the array.
inline std::span<const env::Action> ActionsOf(const Array<float>& actions, int batch_size) {
  RequireShape("actions", actions, {batch_size, env::kActionSize});
  return {reinterpret_cast<const env::Action*>(actions.data()),
          static_cast<std::size_t>(batch_size)};
}

}  // namespace slalom::python
