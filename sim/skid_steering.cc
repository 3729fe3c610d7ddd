#include "sim/skid_steering.h"

#include <algorithm>

#include "base/geometry.h"
#include "sim/mass_distribution.h"
#include "sim/vector_lanes.h"

namespace slalom::sim {
namespace {

static_assert(SkidLanes::kSize == kLanes);

constexpr double kGravity = 9.8;  // As the original's worlds set it, [m/s^2].
constexpr float kCreep = 1e-3f;   // Below this slip, friction fades, [m/s].
constexpr float kArm = 0.25f;     // From the centre to a contact, about, [m].

SLALOM_ALWAYS_INLINE Floats Get(const SkidLanes::Each& each) { return Load(each.data()); }
SLALOM_ALWAYS_INLINE void Set(SkidLanes::Each& each, Floats v) { Store(each.data(), v); }

using Contacts = SkidContacts<SkidLanes::Each>;

/// The nearest whole number. Requires: |a| < 1000.
SLALOM_ALWAYS_INLINE Floats Round(Floats a) {
  constexpr float kShift = 1024.0f;  // Positive numbers are truncated downwards.
  return ToFloats(ToInts(a + (kShift + 0.5f))) - kShift;
}

/// `a`, held between -bound and bound.
SLALOM_ALWAYS_INLINE Floats Within(Floats a, Floats bound) { return Max(Min(a, bound), -bound); }

/// Taylor's polynomials: within 4e-6 up to a quarter turn, within 1e-7 up to an eighth.
SLALOM_ALWAYS_INLINE Floats SineNearZero(Floats a) {
  const Floats z = a * a;
  return a * (1.0f + z * (-1.0f / 6 + z * (1.0f / 120 + z * (-1.0f / 5040 + z / 362880))));
}
SLALOM_ALWAYS_INLINE Floats CosineNearZero(Floats a) {
  const Floats z = a * a;
  return 1.0f +
         z * (-0.5f + z * (1.0f / 24 + z * (-1.0f / 720 + z * (1.0f / 40320 - z / 3628800))));
}

struct SinesCosines {
  Floats sin, cos;
};

/// Within 3e-7. Requires: |angle| < 1000 [rad].
SLALOM_ALWAYS_INLINE SinesCosines SinCos(Floats angle) {
  const Floats n = Round(angle * 0.636619772f);
  // A quarter turn in three parts, of which the first two have few bits.
  const Floats r = ((angle - n * 1.5703125f) - n * 4.83751297e-4f) - n * 7.5497899e-8f;
  const Floats s = SineNearZero(r), c = CosineNearZero(r);
  const Ints quadrant = ToInts(n + 1024.0f) & 3;
  const Ints swap = (quadrant & 1) != 0;
  const Floats sine = swap ? c : s, cosine = swap ? s : c;
  const Ints below = quadrant >= 2, left = (quadrant == 1) | (quadrant == 2);
  return {below ? -sine : sine, left ? -cosine : cosine};
}

struct Velocities {
  Floats ahead, left, yaw_rate;
};

/// Grip of an axle's contacts, by the wheel on the left and on the right.
struct AxleGrips {
  Floats part[2], press[2];
};

/// The sums over contacts of a viscous friction that acts like the dry one at some slip.
struct Drag {
  Floats ahead{}, ahead_y{}, ahead_yy{};  // Ahead, by powers of y: [kg], [kg m], [kg m^2].
  Floats push{}, push_y{};                // The same with the speeds of the wheels.
  Floats front{}, rear{};                 // To the left, of an axle, [kg].
};

template <FrictionLaw law>
SLALOM_ALWAYS_INLINE Drag DragAt(const Contacts& contacts, const AxleGrips& front_grips,
                                 const AxleGrips& rear_grips, const Velocities& now,
                                 const Velocities& v, const Floats wheels[2]) {
  // Speeding up takes weight off the wheels in front and on that side.
  const Floats most_shift = Get(contacts.most_shift);
  const Floats to_rear = Within(Get(contacts.shift_ahead) * (v.ahead - now.ahead), most_shift);
  const Floats to_right =
      Within(Get(contacts.shift_left) * (v.left - now.left), most_shift - Abs(to_rear));
  const Floats slip_front = v.left + v.yaw_rate * Get(contacts.front);
  const Floats slip_rear = v.left + v.yaw_rate * Get(contacts.rear);
  const Floats square_front = slip_front * slip_front, square_rear = slip_rear * slip_rear;
  Drag drag;
  for (int edge = 0; edge < 4; ++edge) {
    const int side = edge / 2;
    const Floats y = Get(contacts.edges[edge]);
    const Floats to_other_side = side == 0 ? to_right : -to_right;
    Floats front = Get(contacts.front_grips[edge]) - to_rear - to_other_side;
    Floats rear = Get(contacts.rear_grips[edge]) + to_rear - to_other_side;
    const Floats slip = (v.ahead - v.yaw_rate * y) - wheels[side];
    const Floats square = slip * slip + kCreep * kCreep;
    if constexpr (law == FrictionLaw::kCone) {
      const Floats front_root = Sqrt(square + square_front), rear_root = Sqrt(square + square_rear);
      const Floats inverse = 1.0f / (front_root * rear_root);  // One division for two.
      front = front * rear_root * inverse;
      rear = rear * front_root * inverse;
      drag.front += front;
      drag.rear += rear;
    } else {
      const Floats root = Sqrt(square);
      if constexpr (law == FrictionLaw::kGazebo) {
        const Floats front_bound = root + front_grips.press[side] * slip;
        const Floats rear_bound = root + rear_grips.press[side] * slip;
        const Floats inverse = 1.0f / (front_bound * rear_bound);
        front = front * front_grips.part[side] * rear_bound * inverse;
        rear = rear * rear_grips.part[side] * front_bound * inverse;
      } else {
        const Floats inverse = 1.0f / root;
        front = front * inverse;
        rear = rear * inverse;
      }
      drag.front += front * root;
      drag.rear += rear * root;
    }
    const Floats ahead = front + rear, ahead_y = ahead * y;
    drag.ahead += ahead;
    drag.ahead_y += ahead_y;
    drag.ahead_yy += ahead_y * y;
    drag.push += ahead * wheels[side];
    drag.push_y += ahead_y * wheels[side];
  }
  if constexpr (law != FrictionLaw::kCone) {
    drag.front = drag.front / Sqrt(square_front + kCreep * kCreep);
    drag.rear = drag.rear / Sqrt(square_rear + kCreep * kCreep);
  }
  return drag;
}

/// The velocity after a step from `now` under that drag. Three linear equations, of which the first
/// two are solved for the speeds in terms of the turn rate:
///
///     heavy_ahead ahead - ahead_y yaw_rate = push_ahead
///     heavy_left left + left_x yaw_rate = push_left
///     (inertia + ahead_yy + left_xx) yaw_rate - ahead_y ahead + left_x left = push_turn.
SLALOM_ALWAYS_INLINE Velocities After(const Contacts& contacts, const Velocities& now,
                                      const Drag& drag) {
  const Floats front = Get(contacts.front), rear = Get(contacts.rear);
  const Floats mass = Get(contacts.mass), inertia = Get(contacts.inertia);
  const Floats left_x = front * drag.front + rear * drag.rear;
  const Floats left_xx = (front * front) * drag.front + (rear * rear) * drag.rear;
  const Floats heavy_ahead = mass + drag.ahead;
  const Floats heavy_left = mass + (drag.front + drag.rear);
  const Floats push_ahead = mass * now.ahead + drag.push;
  const Floats push_left = mass * now.left;
  const Floats push_turn = inertia * now.yaw_rate - drag.push_y;
  const Floats both = heavy_ahead * heavy_left;
  const Floats yaw_rate =
      (push_turn * both + drag.ahead_y * push_ahead * heavy_left -
       left_x * push_left * heavy_ahead) /
      ((inertia + drag.ahead_yy + left_xx) * both - drag.ahead_y * drag.ahead_y * heavy_left -
       left_x * left_x * heavy_ahead);
  const Floats inverse = 1.0f / both;
  return {(push_ahead + drag.ahead_y * yaw_rate) * heavy_left * inverse,
          (push_left - left_x * yaw_rate) * heavy_ahead * inverse, yaw_rate};
}

SLALOM_ALWAYS_INLINE bool AnySet(Ints mask) {
  long long parts[kLanes / 2];
  std::memcpy(parts, &mask, sizeof mask);
  return (parts[0] | parts[1] | parts[2] | parts[3]) != 0;
}

/// The velocity after an implicit step. For cone and pyramid with given loads it minimises
///
///     1/2 |change|^2 in the kinetic norm + dt x sum over contacts of friction x n x |s|
///
/// (|s_ahead| + |s_left| for the pyramid), by rounds of Weiszfeld's fixed point: friction in a
/// round is viscous, as strong as dry friction is at the slip found last. Newton's method would
/// need a line search here. Each round alone takes kinetic energy from a body on standing wheels,
/// for any step size and any law, and leaves a steady state unchanged. A round is one long chain of
/// operations that a processor cannot shorten, so robots go side by side, each in a lane; one that
/// has ended waits for the others. `others`: lanes of other laws, whose result means nothing.
template <FrictionLaw law>
SLALOM_ALWAYS_INLINE Velocities Search(const SkidLanes& lanes, const Velocities& now,
                                       const Velocities& near, const Floats wheels[2],
                                       Ints others) {
  // A round that changes the velocity by less is the last, [m/s].
  constexpr float kStill = 5e-4f;
  const Contacts& contacts = lanes.contacts;
  AxleGrips front_grips, rear_grips;
  if constexpr (law == FrictionLaw::kGazebo) {
    const Floats friction = Get(contacts.friction);
    for (int side = 0; side < 2; ++side) {
      const Floats front = Get(lanes.angles[side]), rear = Get(lanes.angles[2 + side]);
      front_grips.part[side] = Max(CosineNearZero(front), Floats{});
      front_grips.press[side] = friction * SineNearZero(front);
      rear_grips.part[side] = Max(CosineNearZero(rear), Floats{});
      rear_grips.press[side] = friction * SineNearZero(rear);
    }
  }
  Velocities v = near;
  Ints done = others;
  for (int round = 0; round < SkidSteering::kMaxRounds; ++round) {
    const Velocities next =
        After(contacts, now, DragAt<law>(contacts, front_grips, rear_grips, now, v, wheels));
    const Floats change = Abs(next.ahead - v.ahead) + Abs(next.left - v.left) +
                          kArm * Abs(next.yaw_rate - v.yaw_rate);
    v = {done ? v.ahead : next.ahead, done ? v.left : next.left, done ? v.yaw_rate : next.yaw_rate};
    done = done | (change < Fill(kStill));
    if (!AnySet(~done)) break;
  }
  return v;
}

// Half a step.
SLALOM_ALWAYS_INLINE void TurnWheels(const Floats wheels[2], SkidLanes& lanes) {
  constexpr float kHalfTurn = 3.14159265f;
  const Floats radians_per_metre = 0.5f * lanes.dt * Get(lanes.contacts.inverse_radius);
  for (int wheel = 0; wheel < 4; ++wheel) {
    SkidLanes::Each& angle = lanes.angles[wheel];
    const Floats turned = Get(angle) + wheels[wheel % 2] * radians_per_metre;
    Set(angle, turned - Round(turned * (1.0f / kHalfTurn)) * kHalfTurn);
  }
}

/// Sets `v` in the lanes of this law.
template <FrictionLaw law>
SLALOM_ALWAYS_INLINE void SearchOwnLanes(SkidLanes& lanes, const Velocities& now,
                                         const Velocities& near, const Floats wheels[2],
                                         Velocities& v) {
  Ints own;
  std::memcpy(&own, lanes.laws.data(), sizeof own);
  own = own == static_cast<int>(law);
  if (!AnySet(own)) return;
  if constexpr (law == FrictionLaw::kGazebo) TurnWheels(wheels, lanes);
  const Velocities found = Search<law>(lanes, now, near, wheels, ~own);
  if constexpr (law == FrictionLaw::kGazebo) TurnWheels(wheels, lanes);
  v = {own ? found.ahead : v.ahead, own ? found.left : v.left, own ? found.yaw_rate : v.yaw_rate};
}

SLALOM_VECTOR_CLONES
void StepLanes(SkidLanes& lanes) {
  const Velocities last{Get(lanes.ahead), Get(lanes.left), Get(lanes.yaw_rate)};
  const Velocities before{Get(lanes.ahead_before), Get(lanes.left_before),
                          Get(lanes.yaw_rate_before)};
  const auto [turn_sin, turn_cos] = SinCos(Get(lanes.turn));
  const Velocities now{turn_cos * last.ahead + turn_sin * last.left,
                       turn_cos * last.left - turn_sin * last.ahead, last.yaw_rate};
  const Velocities near{2.0f * last.ahead - before.ahead, 2.0f * last.left - before.left,
                        2.0f * last.yaw_rate - before.yaw_rate};
  const Floats wheels[2] = {Get(lanes.wheel_left), Get(lanes.wheel_right)};
  Velocities v{};
  SearchOwnLanes<FrictionLaw::kCone>(lanes, now, near, wheels, v);
  SearchOwnLanes<FrictionLaw::kPyramid>(lanes, now, near, wheels, v);
  SearchOwnLanes<FrictionLaw::kGazebo>(lanes, now, near, wheels, v);
  const auto [s, c] = SinCos(Get(lanes.yaw) + (0.5f * lanes.dt) * last.yaw_rate);
  Set(lanes.vx, c * v.ahead - s * v.left);
  Set(lanes.vy, s * v.ahead + c * v.left);
  // From half-way through this step, at the old rate up to there, to half-way through the next.
  Set(lanes.turn, lanes.dt * (1.5f * v.yaw_rate - 0.5f * last.yaw_rate));
  Set(lanes.ahead_before, last.ahead);
  Set(lanes.left_before, last.left);
  Set(lanes.yaw_rate_before, last.yaw_rate);
  Set(lanes.ahead, v.ahead);
  Set(lanes.left, v.left);
  Set(lanes.yaw_rate, v.yaw_rate);
}

SkidContacts<float> ContactsOf(const RobotConfig& config, double dt) {
  const MassDistribution masses = DistributeMass(config);
  const double impulse = config.wheel_friction * masses.mass * kGravity * dt;
  const double shift = 0.25 * config.wheel_friction * masses.mass * masses.height;
  SkidContacts<float> contacts{.friction = static_cast<float>(config.wheel_friction),
                               .inverse_radius = static_cast<float>(1.0 / config.wheel_radius),
                               .mass = static_cast<float>(masses.mass),
                               .inertia = static_cast<float>(masses.yaw_inertia),
                               .front = static_cast<float>(0.5 * config.wheel_base - masses.x),
                               .rear = static_cast<float>(-0.5 * config.wheel_base - masses.x),
                               .shift_ahead = static_cast<float>(shift / config.wheel_base),
                               .shift_left = static_cast<float>(shift / config.track)};
  for (int edge = 0; edge < 4; ++edge) {
    const int side = edge / 2;
    const double middle = (side == 0 ? 0.5 : -0.5) * config.track;
    const double to_edge = (edge % 2 == 0 ? 0.5 : -0.5) * config.wheel_width;
    contacts.edges[edge] = static_cast<float>(middle + to_edge - masses.y);
    contacts.front_grips[edge] = static_cast<float>(0.5 * impulse * masses.loads[side]);
    contacts.rear_grips[edge] = static_cast<float>(0.5 * impulse * masses.loads[2 + side]);
  }
  // A little less, so that rounding leaves nothing negative.
  contacts.most_shift = 0.999f * std::min(std::ranges::min(contacts.front_grips),
                                          std::ranges::min(contacts.rear_grips));
  return contacts;
}

}  // namespace

void SkidLanes::Step() { StepLanes(*this); }

void SkidLanes::Resume(int lane, float new_yaw, float new_vx, float new_vy, float new_yaw_rate,
                       double exact_dt) {
  const auto [s, c] = base::SinCos(new_yaw + 0.5 * exact_dt * new_yaw_rate);
  ahead[lane] = ahead_before[lane] = static_cast<float>(c * new_vx + s * new_vy);
  left[lane] = left_before[lane] = static_cast<float>(c * new_vy - s * new_vx);
  yaw_rate[lane] = yaw_rate_before[lane] = new_yaw_rate;
  turn[lane] = 0.0f;
}

SkidSteering::SkidSteering(const RobotConfig& config, double dt)
    : law_(config.friction),
      half_separation_(0.5 * config.track * config.wheel_separation_multiplier),
      half_imbalance_(0.5 * config.wheel_imbalance),
      dt_(static_cast<float>(dt)),
      contacts_(ContactsOf(config, dt)) {}

void SkidSteering::Enter(SkidLanes& lanes, int lane) const {
  SkidContacts<SkidLanes::Each>& all = lanes.contacts;
  all.friction[lane] = contacts_.friction;
  all.inverse_radius[lane] = contacts_.inverse_radius;
  all.mass[lane] = contacts_.mass;
  all.inertia[lane] = contacts_.inertia;
  all.front[lane] = contacts_.front;
  all.rear[lane] = contacts_.rear;
  for (int edge = 0; edge < 4; ++edge) {
    all.edges[edge][lane] = contacts_.edges[edge];
    all.front_grips[edge][lane] = contacts_.front_grips[edge];
    all.rear_grips[edge][lane] = contacts_.rear_grips[edge];
  }
  all.shift_ahead[lane] = contacts_.shift_ahead;
  all.shift_left[lane] = contacts_.shift_left;
  all.most_shift[lane] = contacts_.most_shift;
  lanes.laws[lane] = static_cast<std::int32_t>(law_);
  lanes.dt = dt_;
}

}  // namespace slalom::sim
