#pragma once

#include <cstdint>

#include "policy/nn/kernels/small_gemm.h"

/// The algorithm of `SmallGemm` over `Lanes`, the vectors of an instruction set. Each source that
/// instantiates it is compiled for its own instruction set, so no function here may be shared with
/// other sources: all are members of templates over their `Lanes`.

namespace slalom::nn {

/// Columns of B are packed, a panel of two vectors at a time, into scratch memory where they lie as
/// the innermost loop reads them. Against such a panel, which stays in the nearest cache, blocks of
/// rows of A are multiplied into a tile of C that stays in registers.
///
/// `Lanes`: V, a vector of kWidth floats; kRows, rows of a tile; Zero, Broadcast, Load, LoadFirst
/// (zeros behind), Store, StoreFirst, Add, MultiplyAdd, KeepPositive, KeepWhere, Transpose.
template <class Lanes>
class SmallGemmKernel {
 public:
  /// `scratch`: [task.k * kPanel] floats, 64-byte aligned.
  static void Run(const GemmTask& task, float* scratch) {
    if (task.n <= kMaxNarrow && !task.transpose_a) return RunNarrow(task, scratch);
    for (std::int64_t j = 0; j < task.n; j += kPanel) {
      const std::int64_t columns = task.n - j < kPanel ? task.n - j : kPanel;
      if (columns > kWidth) {
        RunPanel<2>(task, j, columns, scratch);
      } else {
        RunPanel<1>(task, j, columns, scratch);
      }
    }
  }

  /// Writes w [n, k], rows `ldw` apart, as the panels that `RunPacked` reads: the columns of w^T,
  /// one panel after the other, or w itself if n <= kMaxNarrow. `panels`: [PackedColumns(n) * k].
  static void PackWeights(const float* w, std::int64_t ldw, std::int64_t n, std::int64_t k,
                          float* panels) {
    if (n <= kMaxNarrow) {
      for (std::int64_t j = 0; j < n; ++j) {
        for (std::int64_t i = 0; i < k; ++i) panels[j * k + i] = w[j * ldw + i];
      }
      return;
    }
    for (std::int64_t j = 0; j < n; j += kWidth) {
      const std::int64_t panel = j / kPanel * kPanel;
      const std::int64_t width = n - panel > kWidth ? kPanel : kWidth;
      PackTransposed(w + j * ldw, ldw, k, n - j < kWidth ? n - j : kWidth,
                     panels + panel * k + (j - panel), width);
    }
  }

  /// Number of columns in the panels of a product with `n` columns.
  static std::int64_t PackedColumns(std::int64_t n) {
    return n <= kMaxNarrow ? n : (n + kWidth - 1) / kWidth * kWidth;
  }

  /// Computes `Run` with transpose_b on the panels that `PackWeights` wrote from `depth` columns of
  /// w: B^T is task.k of these columns, from `first` on. `task.b` and `task.mask` are not used.
  /// Needs no scratch memory, so the depth has no bound.
  static void RunPacked(const GemmTask& task, const float* panels, std::int64_t depth,
                        std::int64_t first) {
    if (task.n <= kMaxNarrow) {
      GemmTask narrow = task;
      narrow.transpose_b = true;
      narrow.b = panels + first;
      narrow.ldb = depth;
      return RunNarrow(narrow, nullptr);
    }
    std::int64_t j = 0;
    // With one row or two the few sums of a panel wait for each other, so several panels are taken
    // at once.
    if (task.m <= 2) {
      for (; j + kTogether * kPanel <= task.n; j += kTogether * kPanel) {
        const float* const b = panels + j * depth + first * kPanel;
        if (task.m == 1) {
          ComputePanels<1>(task, b, depth * kPanel, j);
        } else {
          ComputePanels<2>(task, b, depth * kPanel, j);
        }
      }
    }
    for (; j < task.n; j += kPanel) {
      const std::int64_t columns = task.n - j < kPanel ? task.n - j : kPanel;
      const std::int64_t width = columns > kWidth ? kPanel : kWidth;
      const Tile tile{.a = task.a,
                      .b = panels + j * depth + first * width,
                      .ldb = width,
                      .c = task.c + j,
                      .mask = nullptr,
                      .bias = task.bias == nullptr ? nullptr : task.bias + j,
                      .columns = columns};
      if (columns > kWidth) {
        RunRows<2>(task, tile, task.m);
      } else {
        RunRows<1>(task, tile, task.m);
      }
    }
  }

 private:
  using V = typename Lanes::V;
  static constexpr std::int64_t kWidth = Lanes::kWidth;
  static constexpr std::int64_t kPanel = 2 * kWidth;
  static constexpr int kTogether = 4;                           // Panels, for one row or two.
  static constexpr int kParts = static_cast<int>(16 / kWidth);  // Vectors of sixteen sums.

  /// The memory that a tile reads and writes. `b`: [k, ...], rows `ldb` apart.
  struct Tile {
    const float* a;
    const float* b;
    std::int64_t ldb;
    float* c;
    const float* mask;
    const float* bias;
    std::int64_t columns;
  };

  template <int kVectors>
  static void RunPanel(const GemmTask& task, std::int64_t j, std::int64_t columns, float* scratch) {
    // Few rows do not repay packing.
    const bool in_place = !task.transpose_b && task.m <= 2 && columns == kVectors * kWidth;
    if (task.transpose_b) {
      for (int v = 0; v < kVectors; ++v) {
        const std::int64_t first = v * kWidth;
        PackTransposed(task.b + (j + first) * task.ldb, task.ldb, task.k,
                       columns - first < kWidth ? columns - first : kWidth, scratch + first,
                       kVectors * kWidth);
      }
    } else if (!in_place) {
      Pack<kVectors>(task.b + j, task.ldb, task.k, columns, scratch);
    }
    Tile tile{.a = task.a,
              .b = in_place ? task.b + j : scratch,
              .ldb = in_place ? task.ldb : kVectors * kWidth,
              .c = task.c + j,
              .mask = task.mask == nullptr ? nullptr : task.mask + j,
              .bias = task.bias == nullptr ? nullptr : task.bias + j,
              .columns = columns};
    RunRows<kVectors>(task, tile, task.m);
  }

  /// All rows of C, or the last `left` of them, in one panel.
  template <int kVectors>
  static void RunRows(const GemmTask& task, Tile tile, std::int64_t left) {
    while (left > 0) {
      if (left >= Lanes::kRows) {
        left -= Compute<Lanes::kRows, kVectors>(task, tile);
      } else if (left >= 4) {
        left -= Compute<4, kVectors>(task, tile);
      } else if (left >= 2) {
        left -= Compute<2, kVectors>(task, tile);
      } else {
        left -= Compute<1, kVectors>(task, tile);
      }
    }
  }

  /// Computes a tile and moves `tile` on by its rows, whose number it returns.
  template <int kRows, int kVectors>
  static int Compute(const GemmTask& task, Tile& tile) {
    if (task.transpose_a) {
      ComputeTile<kRows, kVectors, true>(task, tile);
      tile.a += kRows;
    } else {
      ComputeTile<kRows, kVectors, false>(task, tile);
      tile.a += kRows * task.lda;
    }
    tile.c += kRows * task.ldc;
    if (tile.mask != nullptr) tile.mask += kRows * task.ld_mask;
    return kRows;
  }

  template <int kRows, int kVectors, bool kTransposeA>
  static void ComputeTile(const GemmTask& task, const Tile& tile) {
    V sum[kRows][kVectors];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      const V start = tile.bias == nullptr ? Lanes::Zero() : LoadPart<kVectors>(tile.bias, tile, v);
#pragma GCC unroll 16
      for (int r = 0; r < kRows; ++r) {
        sum[r][v] = task.add ? LoadPart<kVectors>(tile.c + r * task.ldc, tile, v) : start;
      }
    }
    const std::int64_t lda = task.lda;
    const std::int64_t ldb = tile.ldb;
    const std::int64_t depth = task.k;
    const float* a = tile.a;
    const float* b = tile.b;
    for (std::int64_t k = 0; k < depth; ++k) {
      V right[kVectors];
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) right[v] = Lanes::Load(b + v * kWidth);
#pragma GCC unroll 16
      for (int r = 0; r < kRows; ++r) {
        const V left = Lanes::Broadcast(kTransposeA ? a[r] : a[r * lda]);
#pragma GCC unroll 2
        for (int v = 0; v < kVectors; ++v) {
          sum[r][v] = Lanes::MultiplyAdd(left, right[v], sum[r][v]);
        }
      }
      a += kTransposeA ? lda : 1;
      b += ldb;
    }
#pragma GCC unroll 16
    for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) {
        V value = sum[r][v];
        if (task.relu) value = Lanes::KeepPositive(value);
        if (tile.mask != nullptr) {
          value =
              Lanes::KeepWhere(LoadPart<kVectors>(tile.mask + r * task.ld_mask, tile, v), value);
        }
        float* const target = tile.c + r * task.ldc + v * kWidth;
        if (v + 1 < kVectors || tile.columns == kVectors * kWidth) {
          Lanes::Store(target, value);
        } else {
          Lanes::StoreFirst(target, value, static_cast<int>(tile.columns - v * kWidth));
        }
      }
    }
  }

  /// One or two rows by `kTogether` whole panels, `stride` apart, which begin at column j.
  template <int kRows>
  static void ComputePanels(const GemmTask& task, const float* panels, std::int64_t stride,
                            std::int64_t j) {
    constexpr int kVectors = 2 * kTogether;
    V sum[kRows][kVectors];
#pragma GCC unroll 8
    for (int v = 0; v < kVectors; ++v) {
      const V start =
          task.bias == nullptr ? Lanes::Zero() : Lanes::Load(task.bias + j + v * kWidth);
#pragma GCC unroll 2
      for (int r = 0; r < kRows; ++r) {
        sum[r][v] = task.add ? Lanes::Load(task.c + r * task.ldc + j + v * kWidth) : start;
      }
    }
    const float* b = panels;
    for (std::int64_t k = 0; k < task.k; ++k) {
      V left[kRows];
#pragma GCC unroll 2
      for (int r = 0; r < kRows; ++r) left[r] = Lanes::Broadcast(task.a[r * task.lda + k]);
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) {
        const V right = Lanes::Load(b + v / 2 * stride + v % 2 * kWidth);
#pragma GCC unroll 2
        for (int r = 0; r < kRows; ++r) sum[r][v] = Lanes::MultiplyAdd(left[r], right, sum[r][v]);
      }
      b += kPanel;
    }
#pragma GCC unroll 2
    for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) {
        const V value = task.relu ? Lanes::KeepPositive(sum[r][v]) : sum[r][v];
        Lanes::Store(task.c + r * task.ldc + j + v * kWidth, value);
      }
    }
  }

  /// Vector v of a row of the tile's width; only its last can be incomplete.
  template <int kVectors>
  static V LoadPart(const float* row, const Tile& tile, int v) {
    return v + 1 < kVectors || tile.columns == kVectors * kWidth
               ? Lanes::Load(row + v * kWidth)
               : Lanes::LoadFirst(row + v * kWidth, static_cast<int>(tile.columns - v * kWidth));
  }

  /// panel[k, j] = b[k, j], with zeros behind the columns.
  template <int kVectors>
  static void Pack(const float* b, std::int64_t ldb, std::int64_t depth, std::int64_t columns,
                   float* panel) {
    const int last = static_cast<int>(columns - (kVectors - 1) * kWidth);
    for (std::int64_t k = 0; k < depth; ++k) {
      if (kVectors == 2) Lanes::Store(panel, Lanes::Load(b));
      Lanes::Store(panel + (kVectors - 1) * kWidth,
                   last == kWidth ? Lanes::Load(b + (kVectors - 1) * kWidth)
                                  : Lanes::LoadFirst(b + (kVectors - 1) * kWidth, last));
      b += ldb;
      panel += kVectors * kWidth;
    }
  }

  /// panel[k, j] = b[j, k] for one vector of columns, with zeros behind them.
  static void PackTransposed(const float* b, std::int64_t ldb, std::int64_t depth,
                             std::int64_t columns, float* panel, std::int64_t ld_panel) {
    V block[kWidth];
    for (std::int64_t k = 0; k < depth; k += kWidth) {
      const int n = static_cast<int>(depth - k < kWidth ? depth - k : kWidth);
#pragma GCC unroll 16
      for (int j = 0; j < kWidth; ++j) {
        block[j] = j >= columns  ? Lanes::Zero()
                   : n == kWidth ? Lanes::Load(b + j * ldb + k)
                                 : Lanes::LoadFirst(b + j * ldb + k, n);
      }
      Lanes::Transpose(block);
      for (int i = 0; i < n; ++i) Lanes::Store(panel + (k + i) * ld_panel, block[i]);
    }
  }

  /// Scalar products of the rows of A with the rows of B^T.
  static void RunNarrow(const GemmTask& task, float* scratch) {
    const float* b = task.b;
    std::int64_t ldb = task.ldb;
    if (!task.transpose_b) {
      for (std::int64_t k = 0; k < task.k; ++k) {
        for (std::int64_t j = 0; j < task.n; ++j) scratch[j * task.k + k] = b[k * ldb + j];
      }
      b = scratch;
      ldb = task.k;
    }
    for (std::int64_t i = 0; i < task.m; i += kWidth) {
      const int rows = static_cast<int>(task.m - i < kWidth ? task.m - i : kWidth);
      for (std::int64_t j = 0; j < task.n; ++j) {
        alignas(64) float values[kWidth];
        Lanes::Store(values, Dots(task.a + i * task.lda, task.lda, rows, b + j * ldb, task.k));
        for (int r = 0; r < rows; ++r) {
          float value = values[r];
          if (task.bias != nullptr) value += task.bias[j];
          const bool kept = (!task.relu || value > 0.0f) &&
                            (task.mask == nullptr || task.mask[(i + r) * task.ld_mask + j] > 0.0f);
          float& target = task.c[(i + r) * task.ldc + j];
          target = (task.add ? target : 0.0f) + (kept ? value : 0.0f);
        }
      }
    }
  }

  /// Scalar products of y with `rows` <= kWidth rows of x; zeros behind them.
  static V Dots(const float* x, std::int64_t ldx, int rows, const float* y, std::int64_t n) {
    V sums[kParts][kWidth];
    for (int r = rows; r < kWidth; ++r) {
      for (int p = 0; p < kParts; ++p) sums[p][r] = Lanes::Zero();
    }
    for (int r = 0; r < rows; ++r) {
      const float* const row = x + r * ldx;
      V sum[kParts];
      for (int p = 0; p < kParts; ++p) sum[p] = Lanes::Zero();
      std::int64_t i = 0;
      for (; i + 16 <= n; i += 16) {
        for (int p = 0; p < kParts; ++p) {
          sum[p] = Lanes::MultiplyAdd(Lanes::Load(row + i + p * kWidth),
                                      Lanes::Load(y + i + p * kWidth), sum[p]);
        }
      }
      for (int p = 0; p < kParts; ++p) {
        const std::int64_t left = n - i - p * kWidth;
        if (left > 0) {
          const int part = static_cast<int>(left < kWidth ? left : kWidth);
          sum[p] = Lanes::MultiplyAdd(Lanes::LoadFirst(row + i + p * kWidth, part),
                                      Lanes::LoadFirst(y + i + p * kWidth, part), sum[p]);
        }
        sums[p][r] = sum[p];
      }
    }
    // Turned, a vector holds one lane of all rows, so the lanes of each are added in turn.
    V total = Lanes::Zero();
    for (int p = 0; p < kParts; ++p) {
      Lanes::Transpose(sums[p]);
      for (int lane = 0; lane < kWidth; ++lane) total = Lanes::Add(total, sums[p][lane]);
    }
    return total;
  }
};

}  // namespace slalom::nn
