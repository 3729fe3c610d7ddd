#include <cstdio>
#include <cstring>

#include "policy/nn/kernels/blas_kernel.h"

/// Prints the kernel in use. With the argument "restart", as the program itself starts: after
/// picking a better one.

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "restart") == 0)
    slalom::nn::RestartWithBetterBlasKernel(argv);
  std::printf("%s", slalom::nn::BlasKernel().c_str());
  return 0;
}
