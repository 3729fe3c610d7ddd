#include "policy/nn/kernels/small_gemm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace slalom::nn {
namespace {

/// What `SmallGemm` promises for one number, step by step; and the same in double with the bound on
/// how far they may be apart.
struct Oracle {
  float promised;
  double exact;
  double bound;
};

/// `before`: what stood in C.
Oracle Compute(const GemmTask& task, std::int64_t i, std::int64_t j, float before) {
  const bool narrow = task.n <= kMaxNarrow && !task.transpose_a;
  const float bias = task.add ? before : task.bias == nullptr ? 0.0f : task.bias[j];
  float chain = bias;
  float lanes[16] = {};
  double exact = bias;
  double magnitude = std::abs(exact);
  for (std::int64_t k = 0; k < task.k; ++k) {
    const float a = task.transpose_a ? task.a[k * task.lda + i] : task.a[i * task.lda + k];
    const float b = task.transpose_b ? task.b[j * task.ldb + k] : task.b[k * task.ldb + j];
    chain = std::fma(a, b, chain);
    lanes[k % 16] = std::fma(a, b, lanes[k % 16]);
    exact += static_cast<double>(a) * b;
    magnitude += std::abs(static_cast<double>(a) * b);
  }
  float sum = 0.0f;
  for (const float lane : lanes) sum += lane;
  Oracle oracle{.promised = narrow ? sum + bias : chain, .exact = exact, .bound = 0.0};
  // k + 17 roundings at most (products fused; sixteen lanes and the bias), each of 2^-24 of a
  // partial sum, which is never larger than the sum of the magnitudes; twice that for higher
  // orders.
  oracle.bound = 2.0 * static_cast<double>(task.k + 17) * 0x1p-24 * magnitude;
  const bool masked = task.mask != nullptr && !(task.mask[i * task.ld_mask + j] > 0.0f);
  if (masked || (task.relu && oracle.promised <= 0.0f)) oracle.promised = 0.0f;
  if (masked || (task.relu && exact < 0.0)) oracle.exact = 0.0;
  return oracle;
}

class SmallGemmTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    const CpuFeatures here = DetectCpuFeatures();
    cpu_ = {.avx2_fma = true, .avx512 = GetParam()};
    if (!here.avx2_fma || (cpu_.avx512 && !here.avx512)) GTEST_SKIP() << "not on this processor";
  }

  std::vector<float> RandomNumbers(std::int64_t n) {
    std::vector<float> values(static_cast<std::size_t>(n));
    for (float& value : values) value = static_cast<float>(random_.Uniform(-1.0, 1.0));
    return values;
  }

  /// Random matrices of a shape, with gaps behind their rows and starts off any alignment.
  void CheckShape(std::int64_t m, std::int64_t n, std::int64_t k) {
    SCOPED_TRACE(testing::Message() << m << " x " << n << " x " << k);
    constexpr float kUntouched = 77.0f;
    GemmTask task{.m = m, .n = n, .k = k};
    task.transpose_a = random_.UniformInt(2) == 1;
    task.transpose_b = random_.UniformInt(2) == 1;
    const auto gap = [&] { return static_cast<std::int64_t>(random_.UniformInt(5)); };
    task.lda = (task.transpose_a ? m : k) + gap();
    task.ldb = (task.transpose_b ? k : n) + gap();
    task.ldc = n + 1 + gap();
    task.ld_mask = n + gap();
    const std::int64_t start = 1 + gap();
    // No number lies behind the last of A and B, so that the address sanitizer sees a read too far.
    const auto a = RandomNumbers(start + ((task.transpose_a ? k : m) - 1) * task.lda +
                                 (task.transpose_a ? m : k));
    const auto b = RandomNumbers(start + ((task.transpose_b ? n : k) - 1) * task.ldb +
                                 (task.transpose_b ? k : n));
    const auto bias = RandomNumbers(n);
    const auto mask = RandomNumbers((m - 1) * task.ld_mask + n);
    std::vector<float> c(static_cast<std::size_t>(start + m * task.ldc), kUntouched);
    task.a = a.data() + start;
    task.b = b.data() + start;
    task.c = c.data() + start;
    task.add = random_.UniformInt(3) == 0;
    if (!task.add) {
      if (random_.UniformInt(2) == 1) task.bias = bias.data();
      task.relu = random_.UniformInt(2) == 1;
      if (random_.UniformInt(2) == 1) task.mask = mask.data();
    }
    ASSERT_TRUE(SmallGemm(task, cpu_));
    for (std::int64_t i = 0; i < m; ++i) {
      for (std::int64_t j = 0; j < n; ++j) {
        const Oracle oracle = Compute(task, i, j, kUntouched);
        ASSERT_EQ(task.c[i * task.ldc + j], oracle.promised) << "at " << i << ", " << j;
        ASSERT_NEAR(task.c[i * task.ldc + j], oracle.exact, oracle.bound);
      }
      for (std::int64_t j = n; j < task.ldc; ++j) ASSERT_EQ(task.c[i * task.ldc + j], kUntouched);
    }
    for (std::int64_t i = 0; i < start; ++i) ASSERT_EQ(c[static_cast<std::size_t>(i)], kUntouched);
  }

  CpuFeatures cpu_;
  base::Random random_{20};
};

TEST_P(SmallGemmTest, KeepsItsPromiseInEveryBitForOddShapes) {
  for (int repeat = 0; repeat < 400; ++repeat) {
    const auto size = [&](std::uint64_t most) {
      return 1 + static_cast<std::int64_t>(random_.UniformInt(most));
    };
    ASSERT_NO_FATAL_FAILURE(CheckShape(size(40), size(80), size(70)));
  }
}

TEST_P(SmallGemmTest, KeepsItsPromiseForTheShapesOfTheNetworks) {
  for (int repeat = 0; repeat < 8; ++repeat) {
    for (const std::int64_t n : {1, 2, 3, 4, 5, 16, 32, 78, 128}) {
      ASSERT_NO_FATAL_FAILURE(CheckShape(repeat % 2 == 0 ? 64 : 5, n, 78));
    }
  }
  ASSERT_NO_FATAL_FAILURE(CheckShape(9, 33, kMaxSmallDepth));
}

TEST_P(SmallGemmTest, TurnsWhatIsNotANumberIntoZeroUnderRelu) {
  const float a[] = {NAN}, b[] = {1.0f, 1.0f, 1.0f, 1.0f, 1.0f};
  float c[5];
  const GemmTask task{
      .m = 1, .n = 5, .k = 1, .a = a, .lda = 1, .b = b, .ldb = 5, .c = c, .ldc = 5, .relu = true};
  ASSERT_TRUE(SmallGemm(task, cpu_));
  for (const float value : c) EXPECT_EQ(value, 0.0f);
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, SmallGemmTest, testing::Bool(),
                         [](const auto& test) { return test.param ? "Avx512" : "Avx2"; });

TEST(SmallGemm, LeavesToTheBlasWhatItCannotDo) {
  const std::vector<float> a(kMaxSmallDepth + 1), b(kMaxSmallDepth + 1);
  float c = 5.0f;
  GemmTask task{
      .m = 1, .n = 1, .k = 1, .a = a.data(), .lda = 1, .b = b.data(), .ldb = 1, .c = &c, .ldc = 1};
  EXPECT_FALSE(SmallGemm(task, CpuFeatures{}));
  task.k = task.lda = kMaxSmallDepth + 1;
  EXPECT_FALSE(SmallGemm(task, DetectCpuFeatures()));
  EXPECT_EQ(c, 5.0f);
}

}  // namespace
}  // namespace slalom::nn
