#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "policy/nn/kernels/cpu_features.h"

/// Debian's OpenBLAS does not know processors that are newer than it. It takes them for a Prescott
/// and is then 3 to 10 times too slow. Its kernel can only be chosen before it is loaded, by
/// OPENBLAS_CORETYPE.

namespace slalom::nn {

/// The kernel that OpenBLAS chose ("Haswell", "Prescott", ...). Empty if the BLAS is not OpenBLAS.
std::string BlasKernel();

/// The kernel to ask for instead of `kernel`. Empty if that one suits the processor, or if the user
/// has chosen one (`user_choice`: the value of OPENBLAS_CORETYPE, if set).
std::optional<std::string> BetterBlasKernel(std::string_view kernel, const CpuFeatures& cpu,
                                            std::optional<std::string_view> user_choice);

/// If OpenBLAS chose an old kernel, sets OPENBLAS_CORETYPE and restarts this program in its place,
/// with the same arguments. Otherwise returns. Call it first in `main`, before any thread starts.
/// Restarts at most once; if the restart fails, the program goes on with the slow kernel.
void RestartWithBetterBlasKernel(char** argv);

}  // namespace slalom::nn
