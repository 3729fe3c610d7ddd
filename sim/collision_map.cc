#include "sim/collision_map.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "sim/vector_lanes.h"

namespace slalom::sim {
namespace {

constexpr float kCell = 0.5f;       // [m]
constexpr float kFarAway = 1.0e6f;  // [m]

SLALOM_VECTOR_CLONES
float NearestCircle(const CollisionMap& map, std::span<const CollisionMap::Run> runs,
                    const Footprint& footprint, const FootprintPose& pose, float limit) {
  const Floats zero{};
  Floats nearest = Fill(limit);
  for (const CollisionMap::Run& run : runs) {
    for (int i = run.begin; i < run.end; i += kLanes) {
      const Floats dx = Load(map.x() + i) - pose.x;
      const Floats dy = Load(map.y() + i) - pose.y;
      // The circle's centre against the rectangle: beyond each pair of sides by qx, qy.
      const Floats qx = Abs(pose.cos_yaw * dx + pose.sin_yaw * dy) - footprint.half_length;
      const Floats qy = Abs(pose.cos_yaw * dy - pose.sin_yaw * dx) - footprint.half_width;
      const Floats out_x = Max(qx, zero);
      const Floats out_y = Max(qy, zero);
      const Floats outside = Sqrt(out_x * out_x + out_y * out_y);
      const Floats inside = Min(Max(qx, qy), zero);
      nearest = Min(nearest, outside + inside - Load(map.radius() + i));
    }
  }
  float result = limit;
  for (int k = 0; k < kLanes; ++k) result = std::min(result, nearest[k]);
  return result;
}

}  // namespace

FootprintPose MakeFootprintPose(float x, float y, float yaw) {
  const auto [sin_yaw, cos_yaw] = base::SinCos(yaw);
  return {x, y, static_cast<float>(cos_yaw), static_cast<float>(sin_yaw)};
}

float CircleClearance(float x, float y, float radius, const Footprint& footprint,
                      const FootprintPose& pose) {
  const float dx = x - pose.x, dy = y - pose.y;
  const float qx = std::abs(pose.cos_yaw * dx + pose.sin_yaw * dy) - footprint.half_length;
  const float qy = std::abs(pose.cos_yaw * dy - pose.sin_yaw * dx) - footprint.half_width;
  const float out_x = std::max(qx, 0.0f), out_y = std::max(qy, 0.0f);
  return std::sqrt(out_x * out_x + out_y * out_y) + std::min(std::max(qx, qy), 0.0f) - radius;
}

// Largest gap between the rectangles' shadows on their four side directions (separating axes).
float BoxClearance(const PlacedBox& box, const Footprint& footprint, const FootprintPose& pose) {
  const float dx = box.x - pose.x;
  const float dy = box.y - pose.y;
  const float c = std::abs(pose.cos_yaw * box.cos_yaw + pose.sin_yaw * box.sin_yaw);
  const float s = std::abs(pose.cos_yaw * box.sin_yaw - pose.sin_yaw * box.cos_yaw);
  const float along_rx = std::abs(pose.cos_yaw * dx + pose.sin_yaw * dy);
  const float along_ry = std::abs(pose.cos_yaw * dy - pose.sin_yaw * dx);
  const float along_bx = std::abs(box.cos_yaw * dx + box.sin_yaw * dy);
  const float along_by = std::abs(box.cos_yaw * dy - box.sin_yaw * dx);
  return std::max({along_rx - footprint.half_length - (c * box.half_x + s * box.half_y),
                   along_ry - footprint.half_width - (s * box.half_x + c * box.half_y),
                   along_bx - box.half_x - (c * footprint.half_length + s * footprint.half_width),
                   along_by - box.half_y - (s * footprint.half_length + c * footprint.half_width)});
}

CollisionMap::CollisionMap(const Course& course)
    : num_circles_(static_cast<int>(course.circles.size())) {
  for (const Box& box : course.boxes) {
    const auto [sin_yaw, cos_yaw] = base::SinCos(box.X_WB.yaw);
    boxes_.push_back({.x = static_cast<float>(box.X_WB.p.x),
                      .y = static_cast<float>(box.X_WB.p.y),
                      .cos_yaw = static_cast<float>(cos_yaw),
                      .sin_yaw = static_cast<float>(sin_yaw),
                      .half_x = static_cast<float>(box.half_size.x),
                      .half_y = static_cast<float>(box.half_size.y),
                      .yaw = static_cast<float>(box.X_WB.yaw)});
  }
  base::Vec2 low{0.0, 0.0}, high{0.0, 0.0};
  if (num_circles_ > 0) low = high = course.circles.front().p_W;
  for (const Circle& circle : course.circles) {
    low = {std::min(low.x, circle.p_W.x), std::min(low.y, circle.p_W.y)};
    high = {std::max(high.x, circle.p_W.x), std::max(high.y, circle.p_W.y)};
    max_radius_ = std::max(max_radius_, static_cast<float>(circle.radius));
  }
  const double extent = std::max(high.x - low.x, high.y - low.y);
  const double cell = std::max(static_cast<double>(kCell), extent / (kMaxRows - 1));
  min_x_ = static_cast<float>(low.x);
  min_y_ = static_cast<float>(low.y);
  inverse_cell_ = static_cast<float>(1.0 / cell);
  columns_ = std::min(kMaxRows, static_cast<int>((high.x - low.x) / cell) + 1);
  rows_ = std::min(kMaxRows, static_cast<int>((high.y - low.y) / cell) + 1);

  std::vector<int> cell_of(num_circles_);
  for (int i = 0; i < num_circles_; ++i) {
    const base::Vec2 p = course.circles[i].p_W;
    cell_of[i] = Row(static_cast<float>(p.y)) * columns_ + Column(static_cast<float>(p.x));
  }
  std::vector<int> order(num_circles_);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return cell_of[a] < cell_of[b]; });
  cell_begin_.assign(static_cast<std::size_t>(rows_) * columns_ + 1, 0);
  for (const int cell_index : cell_of) ++cell_begin_[cell_index + 1];
  std::partial_sum(cell_begin_.begin(), cell_begin_.end(), cell_begin_.begin());
  for (const int i : order) {
    x_.push_back(static_cast<float>(course.circles[i].p_W.x));
    y_.push_back(static_cast<float>(course.circles[i].p_W.y));
    radius_.push_back(static_cast<float>(course.circles[i].radius));
  }
  x_.insert(x_.end(), kLanes, kFarAway);
  y_.insert(y_.end(), kLanes, kFarAway);
  radius_.insert(radius_.end(), kLanes, 0.0f);
}

// Clamped in floating point first, as a far-away coordinate does not fit an int.
int CollisionMap::Row(float y) const {
  return static_cast<int>(
      std::clamp((y - min_y_) * inverse_cell_, 0.0f, static_cast<float>(rows_ - 1)));
}

int CollisionMap::Column(float x) const {
  return static_cast<int>(
      std::clamp((x - min_x_) * inverse_cell_, 0.0f, static_cast<float>(columns_ - 1)));
}

void CollisionMap::FindCircles(float x, float y, float reach, Runs& found) const {
  found.size = 0;
  const float far = reach + max_radius_;
  const int first_column = Column(x - far), last_column = Column(x + far);
  const int first_row = Row(y - far), last_row = Row(y + far);
  for (int row = first_row; row <= last_row; ++row) {
    const int begin = cell_begin_[row * columns_ + first_column];
    const int end = cell_begin_[row * columns_ + last_column + 1];
    if (begin == end) continue;
    if (found.size > 0 && found.runs[found.size - 1].end == begin) {
      found.runs[found.size - 1].end = end;
    } else {
      found.runs[found.size++] = {begin, end};
    }
  }
}

float CollisionMap::Clearance(const Footprint& footprint, const FootprintPose& pose,
                              float limit) const {
  SLALOM_CHECK_GT(limit, 0.0f);
  Runs runs;
  FindCircles(pose.x, pose.y, footprint.Circumradius() + limit, runs);
  float nearest = NearestCircle(*this, runs.span(), footprint, pose, limit);
  for (const PlacedBox& box : boxes_) {
    nearest = std::min(nearest, BoxClearance(box, footprint, pose));
  }
  return nearest;
}

}  // namespace slalom::sim
