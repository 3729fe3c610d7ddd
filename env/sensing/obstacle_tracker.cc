#include "env/sensing/obstacle_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace slalom::env {
namespace {

// What a piece is.
constexpr double kLeastEcho = 0.05;    // Shorter ranges show nothing, [m].
constexpr int kMostMissing = 2;        // Beams without an echo within a piece.
constexpr double kGap = 0.1;           // Between neighbouring points of a piece, [m],
constexpr double kGapPerMetre = 0.06;  // more for each metre of range.
constexpr double kHollow = 0.1;        // A piece that is hollower is cut, [m].
constexpr int kLeastPiecePoints = 4;
constexpr double kClipMargin =
    0.3;  // A piece that ends so near the end of the range may go on, [m].
// What is measured.
constexpr double kFacing = 0.15;      // Sine of the angle to what is hidden, for what is not.
constexpr double kFlat = 0.02;        // A side is as flat as the noise, [m].
constexpr int kEndPoints = 3;         // Of an end that the body does not show.
constexpr double kPointError = 0.02;  // Standard deviation, beside half the spacing, [m].
// Neighbouring directions share their points, so each counts that much less, as a variance.
constexpr double kShared = 4.0;
constexpr double kOutlier = 4.0;  // Standard deviations.
constexpr int kMostAveraged = 8;  // Scans.
// How bodies move.
constexpr double kPlaceError = 0.01;   // At first, standard deviation, [m].
constexpr double kFirstSpeed = 1.5;    // Standard deviation, [m/s].
constexpr double kAcceleration = 0.6;  // Standard deviation, [m/s^2].
constexpr double kGate = 0.6;          // Between a piece and where its body should be, [m],
constexpr double kFirstGate = 0.9;     // if nothing is known of its velocity.
// What moves.
constexpr double kLeastSpeed = 0.2;    // [m/s]
constexpr double kSureness = 6.0;      // Of the velocity, as a square in standard deviations.
constexpr double kFree = 0.12;         // A beam that goes on for longer sees through, [m].
constexpr double kLeastFreedom = 0.3;  // Share of samples.
constexpr int kMostDoubts = 5;         // Scans after which it is taken to stand.
constexpr int kLeastTrackScans = 2;
constexpr int kMostMissed = 4;  // Scans.
// How large it is.
constexpr double kLeastRadius = 0.05, kMostRadius = 0.6;  // [m]

double DistanceToSegment(base::Vec2 p, base::Vec2 a, base::Vec2 b) {
  const base::Vec2 way = b - a;
  const double square = base::Dot(way, way);
  const double t = square > 0.0 ? std::clamp(base::Dot(p - a, way) / square, 0.0, 1.0) : 0.0;
  return base::Norm(p - a - t * way);
}

double FarthestAlong(base::Vec2 direction, std::span<const base::Vec2> points) {
  double farthest = base::Dot(direction, points.front());
  for (const base::Vec2 p : points) farthest = std::max(farthest, base::Dot(direction, p));
  return farthest;
}

}  // namespace

ObstacleTracker::ObstacleTracker(const ScanGeometry& geometry, double step)
    : geometry_(geometry),
      step_(step),
      angle_step_(geometry.field_of_view / (geometry.num_beams - 1)),
      projector_(geometry) {}

void ObstacleTracker::Reset() {
  num_scans_ = 0;
  bodies_.clear();
  tracks_.clear();
}

void ObstacleTracker::Update(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR) {
  ReadScan(ranges_cm, X_OR);
  FindPieces();
  for (Body& body : bodies_) Predict(body);
  FindMatches();
  for (Body& body : bodies_) ++body.num_missed;
  is_taken_.assign(pieces_.size(), 0);
  for (const Match& match : matches_) {
    Body& body = bodies_[match.body];
    if (body.num_missed == 0 || is_taken_[match.piece] != 0) continue;
    is_taken_[match.piece] = 1;
    Correct(pieces_[match.piece], body);
  }
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    if (is_taken_[i] == 0) Begin(pieces_[i]);
  }
  std::swap(scans_[num_scans_ % kNumScans], now_);
  ++num_scans_;
  std::erase_if(bodies_, [](const Body& body) {
    return body.num_missed > (body.num_scans < kLeastTrackScans ? 0 : kMostMissed);
  });

  tracks_.clear();
  for (const Body& body : bodies_) {
    if (body.moves) tracks_.push_back(TrackOf(body));
  }
  std::ranges::sort(tracks_, {}, [&](const Track& track) {
    return base::Norm(track.p_O - X_OR.p) - track.radius;
  });
}

std::array<double, 4 * kObservedObstacles> ObstacleTracker::Observe(const base::Pose2& X_OR) const {
  std::array<double, 4 * kObservedObstacles> values{};
  const std::size_t size = std::min<std::size_t>(tracks_.size(), kObservedObstacles);
  for (std::size_t i = 0; i < size; ++i) {
    const base::Vec2 p_R = base::InverseTransform(X_OR, tracks_[i].p_O);
    const base::Vec2 v_R = base::InverseTransform({{}, X_OR.yaw}, tracks_[i].v_O);
    std::ranges::copy(std::array{p_R.x, p_R.y, v_R.x, v_R.y}, values.begin() + 4 * i);
  }
  return values;
}

void ObstacleTracker::ReadScan(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR) {
  now_.X_OR = X_OR;
  now_.ranges_cm.assign(ranges_cm.begin(), ranges_cm.end());
  projector_.Project(ranges_cm, X_OR, rays_);
  points_O_.clear();
  beams_.clear();
  for (std::size_t i = 0; i < ranges_cm.size(); ++i) {
    if (!rays_.rays[i].hit || 0.01 * ranges_cm[i] < kLeastEcho) continue;
    points_O_.push_back(rays_.rays[i].p_O);
    beams_.push_back(static_cast<int>(i));
  }
}

void ObstacleTracker::FindPieces() {
  pieces_.clear();
  const int num_points = static_cast<int>(points_O_.size());
  for (int begin = 0, end = 1; begin < num_points; begin = end++) {
    for (; end < num_points; ++end) {
      const int beam = beams_[end], before = beams_[end - 1];
      if (beam - before > kMostMissing + 1) break;
      const double range = 0.01 * std::min(now_.ranges_cm[beam], now_.ranges_cm[before]);
      const double gap = base::Norm(points_O_[end] - points_O_[end - 1]);
      if (gap > kGap + kGapPerMetre * range * (beam - before)) break;
    }
    AddConvexPieces(begin, end);
  }
}

/// Cuts the points [begin, end) where they lie farthest behind the line between their ends.
void ObstacleTracker::AddConvexPieces(int begin, int end) {
  spans_.assign(1, {begin, end});
  while (!spans_.empty()) {
    const auto [first, past] = spans_.back();
    spans_.pop_back();
    if (past - first < kLeastPiecePoints) continue;
    const base::Vec2 from = points_O_[first], way = points_O_[past - 1] - from;
    int deepest = first;
    double depth = kHollow * base::Norm(way);
    base::Vec2 sum;
    for (int i = first; i < past; ++i) {
      sum = sum + points_O_[i];
      const double behind = base::Cross(points_O_[i] - from, way);
      if (behind > depth) depth = behind, deepest = i;
    }
    if (deepest != first) {
      spans_.emplace_back(first, deepest + 1);
      spans_.emplace_back(deepest, past);
      continue;
    }
    pieces_.push_back({.begin = first,
                       .end = past,
                       .shows_begin = first == begin && ShowsEnd(first, -1),
                       .shows_end = past == end && ShowsEnd(past - 1, 1),
                       .middle_O = 1.0 / (past - first) * sum,
                       .first_O = points_O_[first],
                       .last_O = points_O_[past - 1]});
  }
}

/// Whether the body of a point ends at it, as what is beside it, in beams before or after, is
/// farther away.
bool ObstacleTracker::ShowsEnd(int point, int step) const {
  const int beam = beams_[point];
  const int last = beam + step * (kMostMissing + 1);
  if (last < 0 || last >= geometry_.num_beams) return false;
  const double range = 0.01 * now_.ranges_cm[beam];
  for (int i = beam + step; i != last + step; i += step) {
    const double other = 0.01 * now_.ranges_cm[i];
    if (other < geometry_.clip) return other > range;
  }
  return range < geometry_.clip - kClipMargin;
}

/// At a constant velocity, but for a random acceleration.
void ObstacleTracker::Predict(Body& body) const {
  Eigen::Matrix4d transition = Eigen::Matrix4d::Identity();
  transition(0, 2) = transition(1, 3) = step_;
  body.state = transition * body.state;
  body.covariance = transition * body.covariance * transition.transpose();
  const double speed = kAcceleration * step_, place = 0.5 * speed * step_;
  for (const int i : {0, 1}) {
    body.covariance(i, i) += place * place;
    body.covariance(i, i + 2) += place * speed;
    body.covariance(i + 2, i) += place * speed;
    body.covariance(i + 2, i + 2) += speed * speed;
  }
}

/// Lists the pieces that may show each body: each lies near the line through the other, and both
/// are about as long.
void ObstacleTracker::FindMatches() {
  matches_.clear();
  for (int b = 0; b < static_cast<int>(bodies_.size()); ++b) {
    const Body& body = bodies_[b];
    const base::Vec2 p_O{body.state[0], body.state[1]};
    const base::Vec2 middle_O = p_O + body.middle, first_O = p_O + body.first,
                     last_O = p_O + body.last;
    const double length = base::Norm(last_O - first_O);
    const double gate = body.num_scans == 1 ? kFirstGate : kGate;
    for (int i = 0; i < static_cast<int>(pieces_.size()); ++i) {
      const Piece& piece = pieces_[i];
      const double to_piece = DistanceToSegment(middle_O, piece.first_O, piece.last_O);
      if (to_piece > gate) continue;
      const double to_body = DistanceToSegment(piece.middle_O, first_O, last_O);
      if (to_body > gate) continue;
      const double longer = std::abs(base::Norm(piece.last_O - piece.first_O) - length);
      matches_.push_back({to_piece + to_body + 0.5 * longer, b, i});
    }
  }
  std::ranges::sort(matches_, [](const Match& a, const Match& b) {
    return std::tie(a.distance, a.body, a.piece) < std::tie(b.distance, b.body, b.piece);
  });
}

void ObstacleTracker::Begin(const Piece& piece) {
  Body& body = bodies_.emplace_back();
  body.state << piece.middle_O.x, piece.middle_O.y, 0.0, 0.0;
  const Eigen::Array4d errors{kPlaceError, kPlaceError, kFirstSpeed, kFirstSpeed};
  body.covariance = errors.square().matrix().asDiagonal();
  // The first one across the piece, towards the sensor, so that a straight piece shows it.
  const base::Vec2 way = piece.last_O - piece.first_O;
  const double heading = std::atan2(way.x, -way.y);
  for (int k = 0; k < kDirections; ++k) {
    const auto [s, c] = base::SinCos(heading + 2.0 * base::kPi * k / kDirections);
    body.directions[k] = {c, s};
  }
  Correct(piece, body);
}

/// Moves the body to where the piece shows it, and learns how far it reaches.
void ObstacleTracker::Correct(const Piece& piece, Body& body) const {
  const std::span points = std::span(points_O_).subspan(piece.begin, piece.end - piece.begin);
  const std::size_t end_points = std::min<std::size_t>(kEndPoints, points.size() / 3);
  const std::size_t before = piece.shows_begin ? 0 : end_points;
  const std::size_t behind = piece.shows_end ? 0 : end_points;
  const std::span inner = points.subspan(before, points.size() - before - behind);
  const double range = base::Norm(piece.middle_O - rays_.sensor_O);
  const double error = kPointError + 0.5 * range * angle_step_;
  const double variance = kShared * error * error;
  std::array<double, kDirections> farthest{};
  std::array<bool, kDirections> is_shown{};
  for (int k = 0; k < kDirections; ++k) {
    const base::Vec2 u = body.directions[k];
    const double sensor = base::Dot(u, rays_.sensor_O);
    if (sensor - base::Dot(u, piece.middle_O) < kFacing * range) continue;
    farthest[k] = FarthestAlong(u, points);
    is_shown[k] = sensor - farthest[k] >= kFacing * range &&
                  (inner.size() == points.size() || FarthestAlong(u, inner) >= farthest[k] - kFlat);
    const Reach& known = body.reaches[k];
    if (!is_shown[k] || known.num_scans == 0) continue;
    const double innovation =
        farthest[k] - known.distance - u.x * body.state[0] - u.y * body.state[1];
    const Eigen::Vector4d cross = u.x * body.covariance.col(0) + u.y * body.covariance.col(1);
    const double total = u.x * cross[0] + u.y * cross[1] + variance;
    if (innovation * innovation > kOutlier * kOutlier * total) continue;
    const Eigen::Vector4d gain = cross / total;
    body.state += innovation * gain;
    body.covariance -= gain * cross.transpose();
  }
  const base::Vec2 p_O{body.state[0], body.state[1]};
  for (int k = 0; k < kDirections; ++k) {
    if (!is_shown[k]) continue;
    Reach& known = body.reaches[k];
    known.num_scans = std::min(known.num_scans + 1, kMostAveraged);
    known.distance +=
        (farthest[k] - base::Dot(body.directions[k], p_O) - known.distance) / known.num_scans;
  }
  body.middle = piece.middle_O - p_O;
  body.first = piece.first_O - p_O;
  body.last = piece.last_O - p_O;
  body.first_beam = beams_[piece.begin];
  body.end_beam = beams_[piece.end - 1] + 1;
  body.num_missed = 0;
  JudgeMotion(piece, body);
  ++body.num_scans;
}

void ObstacleTracker::JudgeMotion(const Piece& piece, Body& body) const {
  double num_entered = 0.0, num_left = 0.0;
  Samples& samples_O = body.samples_O[body.num_scans % kNumScans];
  for (int i = 0; i < kNumSamples; ++i) {
    const base::Vec2 p_O =
        points_O_[piece.begin + (piece.end - 1 - piece.begin) * i / (kNumSamples - 1)];
    bool enters = false, leaves = false;
    for (int lag = 1; lag <= kNumScans; lag *= 2) {
      if (lag <= num_scans_) enters |= SeesThrough(scans_[(num_scans_ - lag) % kNumScans], p_O);
      if (lag <= body.num_scans) {
        leaves |= SeesThrough(now_, body.samples_O[(body.num_scans - lag) % kNumScans][i]);
      }
    }
    num_entered += enters;
    num_left += leaves;
    samples_O[i] = p_O;
  }
  body.freedom += 0.5 * (std::max(num_entered, num_left) / kNumSamples - body.freedom);

  const Eigen::Vector2d velocity = body.state.tail<2>();
  const Eigen::Matrix2d covariance = body.covariance.bottomRightCorner<2, 2>();
  const bool is_sure = body.num_scans + 1 >= kLeastTrackScans && velocity.norm() > kLeastSpeed &&
                       velocity.dot(covariance.inverse() * velocity) > kSureness &&
                       body.freedom > kLeastFreedom;
  body.num_doubts = is_sure ? 0 : body.num_doubts + 1;
  body.moves = is_sure || (body.moves && body.num_doubts <= kMostDoubts);
}

/// Whether a scan sees something farther away in the direction of a point.
bool ObstacleTracker::SeesThrough(const Scan& scan, base::Vec2 p_O) const {
  const base::Vec2 p_S = base::InverseTransform(scan.X_OR, p_O) - geometry_.p_RS;
  const double beam = (std::atan2(p_S.y, p_S.x) + 0.5 * geometry_.field_of_view) / angle_step_;
  if (beam < 0.0 || beam >= geometry_.num_beams - 1) return false;
  const auto i = static_cast<std::size_t>(beam);
  const double range = 0.01 * std::min(scan.ranges_cm[i], scan.ranges_cm[i + 1]);
  return range > base::Norm(p_S) + kFree;
}

Track ObstacleTracker::TrackOf(const Body& body) {
  constexpr int kHalf = kDirections / 2;
  // Half of the width, as the mean over the directions in which both sides were seen.
  double sum = 0.0, num = 0.0;
  for (int k = 0; k < kHalf; ++k) {
    const Reach &there = body.reaches[k], &back = body.reaches[k + kHalf];
    if (there.num_scans == 0 || back.num_scans == 0) continue;
    sum += 0.5 * (there.distance + back.distance);
    ++num;
  }
  const double half_width = num > 0.0 ? sum / num : 0.5 * base::Norm(body.last - body.first);
  const double radius = std::clamp(half_width, kLeastRadius, kMostRadius);
  // The middle from which it reaches as far there as back, or as far as it is wide; least squares.
  Eigen::Matrix2d normal = 1e-6 * Eigen::Matrix2d::Identity();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (int k = 0; k < kHalf; ++k) {
    const Reach &there = body.reaches[k], &back = body.reaches[k + kHalf];
    if (there.num_scans == 0 && back.num_scans == 0) continue;
    const double middle = back.num_scans == 0    ? there.distance - radius
                          : there.num_scans == 0 ? radius - back.distance
                                                 : 0.5 * (there.distance - back.distance);
    const Eigen::Vector2d u(body.directions[k].x, body.directions[k].y);
    normal += u * u.transpose();
    right += middle * u;
  }
  const Eigen::Vector2d p = body.state.head<2>() + normal.inverse() * right;
  const bool is_hidden = body.num_missed > 0;
  return {.p_O = {p.x(), p.y()},
          .v_O = {body.state[2], body.state[3]},
          .radius = radius,
          .first_beam = is_hidden ? 0 : body.first_beam,
          .end_beam = is_hidden ? 0 : body.end_beam};
}

}  // namespace slalom::env
