#pragma once

#include <cstdint>
#include <vector>

#include "policy/nn/network_shape.h"

/// The matrix products that networks cannot do without. They give the number of FLOPs "really
/// needed", and the BLAS's time for them alone.

namespace slalom {

/// One matrix product, m x k by k x n, and how often.
struct Product {
  std::int64_t m, n, k;
  double count;
};
using Products = std::vector<Product>;

/// A pass of `batch` rows through `shape`.
Products ForwardProducts(const nn::NetworkShape& shape, std::int64_t batch);
/// The gradient by all parameters.
Products BackwardProducts(const nn::NetworkShape& shape, std::int64_t batch);
/// The gradient by a critic's action, which goes through its head only.
Products ActionGradientProducts(const nn::NetworkShape& shape, std::int64_t batch);

/// Adds `more` to `products`, each `times` as often.
void Add(const Products& more, double times, Products* products);

double CountFlops(const Products& products);

/// Processor time [s] of all the products, each run for `seconds_each`, by the BLAS or, if it takes
/// them, by `policy::SmallGemm`.
double MeasureProducts(const Products& products, bool small_gemm, double seconds_each);

}  // namespace slalom
