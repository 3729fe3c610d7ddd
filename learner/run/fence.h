#pragma once

#include <filesystem>
#include <string>

namespace slalom::run {

/// A file that a training must find unchanged to go on writing: the claim of a sweep's worker. A
/// training that stood still for so long that another worker took over, as on a paused machine,
/// then writes nothing into the run of the other. A value; thread-compatible.
class Fence {
 public:
  /// Environment variable that names the file (app/sweep/cell_work.cc sets it).
  static constexpr char kVariable[] = "SLALOM_FENCE";

  /// No fence, which is always held.
  Fence() = default;
  /// Throws `base::Error` if the file cannot be read.
  explicit Fence(std::filesystem::path file);
  /// The fence that the environment names, or none.
  static Fence OfEnvironment();

  /// Whether the file is what it was. True if it cannot be looked at, as a disk that fails for a
  /// moment takes nothing away.
  bool IsHeld() const;
  /// Throws `base::Error` that names the file unless the fence is held.
  void RequireHeld() const;

 private:
  std::filesystem::path file_;
  std::string content_;
};

}  // namespace slalom::run
