#pragma once

#include <cmath>

namespace slalom::base {

inline constexpr double kPi = 3.14159265358979323846;

/// A point or a displacement in the plane, [m]. A value.
struct Vec2 {
  double x = 0.0;
  double y = 0.0;

  friend constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Vec2 operator*(double s, Vec2 v) { return {s * v.x, s * v.y}; }
  friend constexpr bool operator==(Vec2 a, Vec2 b) = default;
};

constexpr double Dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
constexpr double Cross(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }
inline double Norm(Vec2 v) { return std::sqrt(Dot(v, v)); }

struct SinCosResult {
  double sin = 0.0;
  double cos = 1.0;
};

/// Sine and cosine of `angle` [rad], exact to 1e-15. They are computed from additions and
/// multiplications alone, so they have the same bits on every machine. The C library does not
/// promise that.
///
/// Requires: |angle| < 1e5.
SinCosResult SinCos(double angle);

/// The angle in [-pi, pi) that equals `angle` [rad] up to whole turns.
double WrapAngle(double angle);

/// Position and heading of one frame in another: `X_WR` is the pose of R in W. A value.
struct Pose2 {
  Vec2 p;            ///< Origin, [m].
  double yaw = 0.0;  ///< Heading, counter-clockwise from x, [rad].

  friend constexpr bool operator==(const Pose2&, const Pose2&) = default;
};

/// Transforms the point p_R from the frame R of `X_WR` to the frame W.
inline Vec2 Transform(const Pose2& X_WR, Vec2 p_R) {
  const auto [s, c] = SinCos(X_WR.yaw);
  return {X_WR.p.x + c * p_R.x - s * p_R.y, X_WR.p.y + s * p_R.x + c * p_R.y};
}

/// Transforms the point p_W from the frame W to the frame R of `X_WR`.
inline Vec2 InverseTransform(const Pose2& X_WR, Vec2 p_W) {
  const auto [s, c] = SinCos(X_WR.yaw);
  const Vec2 d = p_W - X_WR.p;
  return {c * d.x + s * d.y, -s * d.x + c * d.y};
}

}  // namespace slalom::base
