#include "policy/nn/kernels/blas.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "base/random.h"
#include "policy/nn/kernels/blas_kernel.h"

namespace slalom::nn {
namespace {

constexpr CpuFeatures kOld{};
constexpr CpuFeatures kAvx2{.avx2_fma = true};
constexpr CpuFeatures kAvx512{.avx2_fma = true, .avx512 = true};

TEST(BetterBlasKernel, IsAskedForWhereTheChosenOneIsOld) {
  EXPECT_EQ(BetterBlasKernel("Prescott", kAvx512, std::nullopt), "SkylakeX");
  EXPECT_EQ(BetterBlasKernel("Prescott", kAvx2, std::nullopt), "Haswell");
  EXPECT_EQ(BetterBlasKernel("prescott", kAvx2, std::nullopt), "Haswell");
  EXPECT_EQ(BetterBlasKernel("Sandybridge", kAvx2, std::nullopt), "Haswell");
}

TEST(BetterBlasKernel, IsNotAskedForWithoutNeed) {
  EXPECT_EQ(BetterBlasKernel("Prescott", kOld, std::nullopt), std::nullopt);
  EXPECT_EQ(BetterBlasKernel("Haswell", kAvx512, std::nullopt), std::nullopt);
  EXPECT_EQ(BetterBlasKernel("Zen", kAvx2, std::nullopt), std::nullopt);
  EXPECT_EQ(BetterBlasKernel("Cooperlake", kAvx512, std::nullopt), std::nullopt);
  EXPECT_EQ(BetterBlasKernel("", kAvx512, std::nullopt), std::nullopt);
}

TEST(BetterBlasKernel, LeavesAUsersChoice) {
  EXPECT_EQ(BetterBlasKernel("Prescott", kAvx512, "Prescott"), std::nullopt);
}

std::string RunCommand(const std::string& command) {
  std::string output;
  FILE* const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return output;
  char buffer[256];
  while (const std::size_t n = std::fread(buffer, 1, sizeof(buffer), pipe))
    output.append(buffer, n);
  EXPECT_EQ(pclose(pipe), 0);
  return output;
}

TEST(BlasKernel, FollowsTheVariableAndTheRestart) {
  const std::string program = SLALOM_PRINT_BLAS_KERNEL;
  const std::string chosen = RunCommand("env -u OPENBLAS_CORETYPE " + program);
  if (chosen.empty()) GTEST_SKIP() << "the BLAS here is not OpenBLAS";
  EXPECT_EQ(RunCommand("OPENBLAS_CORETYPE=Prescott " + program), "Prescott");
  EXPECT_EQ(RunCommand("OPENBLAS_CORETYPE=Prescott " + program + " restart"), "Prescott");
  const auto better = BetterBlasKernel(chosen, DetectCpuFeatures(), std::nullopt);
  EXPECT_EQ(RunCommand("env -u OPENBLAS_CORETYPE " + program + " restart"),
            better.value_or(chosen));
}

TEST(Sgemm, MultipliesTransposedAndStridedMatrices) {
  constexpr int kM = 5, kN = 7, kK = 9, kStride = 12;
  base::Random random(1);
  std::vector<float> a(kStride * kStride), b(kStride * kStride);
  for (float& value : a) value = static_cast<float>(random.Uniform(-1.0, 1.0));
  for (float& value : b) value = static_cast<float>(random.Uniform(-1.0, 1.0));
  for (const bool ta : {false, true}) {
    for (const bool tb : {false, true}) {
      std::vector<float> c(kM * kStride, 100.0f);
      Sgemm(ta, tb, kM, kN, kK, a.data(), kStride, b.data(), kStride, c.data(), kStride);
      std::vector<float> added(kM * kStride, 1.0f);
      Sgemm(ta, tb, kM, kN, kK, a.data(), kStride, b.data(), kStride, added.data(), kStride,
            /*add=*/true);
      for (int i = 0; i < kM; ++i) {
        for (int j = 0; j < kN; ++j) {
          double sum = 0.0;
          for (int k = 0; k < kK; ++k) {
            sum += static_cast<double>(ta ? a[k * kStride + i] : a[i * kStride + k]) *
                   (tb ? b[j * kStride + k] : b[k * kStride + j]);
          }
          // Nine products below 1, each rounded to 2^-24 of partial sums below 9.
          EXPECT_NEAR(c[i * kStride + j], sum, 9 * 9 * 0x1p-24);
          added[i * kStride + j] -= static_cast<float>(sum);
        }
        EXPECT_EQ(c[i * kStride + kN], 100.0f) << "wrote beyond its columns";
        for (int j = 0; j < kN; ++j) EXPECT_NEAR(added[i * kStride + j], 1.0f, 9 * 10 * 0x1p-23);
      }
    }
  }
}

// Windows of three numbers, one number apart, as a convolution reads them.
TEST(Sgemm, MultipliesRowsThatOverlap) {
  const std::vector<float> line = {1, 2, 3, 4, 5};
  const std::vector<float> weights = {1, 10, 100};
  std::vector<float> c(3);
  Sgemm(false, false, 3, 1, 3, line.data(), 1, weights.data(), 1, c.data(), 1);
  EXPECT_EQ(c, (std::vector<float>{321, 432, 543}));
}

}  // namespace
}  // namespace slalom::nn
