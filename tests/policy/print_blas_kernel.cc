#include <cstdio>
#include <cstring>

#include "policy/blas.h"

/// Prints the kernel in use. With the argument "restart", as the program itself starts: after
/// picking a better one.

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "restart") == 0)
    slalom::policy::RestartWithBetterBlasKernel(argv);
  std::printf("%s", slalom::policy::BlasKernel().c_str());
  return 0;
}
