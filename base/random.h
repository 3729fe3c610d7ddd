#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <string_view>

namespace slalom::base {

/// Derives a seed from a root seed, the purpose that it serves and indices (actor, episode, ...).
/// Seeds of different purposes or indices are unrelated, so that no stream is shared by accident.
std::uint64_t DeriveSeed(std::uint64_t root, std::string_view purpose,
                         std::initializer_list<std::uint64_t> indices = {});

/// The generator xoshiro256++ (Blackman and Vigna 2019), with samplers of our own because the
/// standard library's differ between implementations. Thread-compatible. A value: a copy continues
/// the same stream.
class Random {
 public:
  using State = std::array<std::uint64_t, 4>;

  explicit Random(std::uint64_t seed);

  std::uint64_t NextU64() {
    const std::uint64_t result = Rotl(s_[0] + s_[3], 23) + s_[0];
    const std::uint64_t t = s_[1] << 17;
    s_[2] ^= s_[0];
    s_[3] ^= s_[1];
    s_[1] ^= s_[2];
    s_[0] ^= s_[3];
    s_[2] ^= t;
    s_[3] = Rotl(s_[3], 45);
    return result;
  }

  /// Uniform in [0, 1).
  double Uniform() { return static_cast<double>(NextU64() >> 11) * 0x1.0p-53; }

  /// Uniform in [low, high).
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  /// Uniform in {0, ..., n - 1}, without bias. Requires: n >= 1.
  std::uint64_t UniformInt(std::uint64_t n);

  /// Normal with mean 0 and standard deviation 1 (inverse of the distribution function, Wichura's
  /// AS 241).
  double Normal();

  const State& state() const { return s_; }
  void set_state(const State& state) { s_ = state; }

 private:
  static std::uint64_t Rotl(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

  State s_;
};

/// The quantile function of the standard normal distribution, relative error below 1e-15 (AS 241).
///
/// Requires: 0 < p < 1.
double NormalQuantile(double p);

}  // namespace slalom::base
