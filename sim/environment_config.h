#pragma once

#include "base/config_field.h"
#include "env/action.h"
#include "env/observation.h"

/// The task's settings. Defaults are the numbers of the original system (docs/original-system.md,
/// sections 1 and 2).

namespace slalom::sim {

/// How the wheels move the body.
enum class DriveKind { kSkidSteer, kIdeal };
inline base::OneOf EnumNames(DriveKind) { return {"skid-steer", "ideal"}; }

/// The law of friction between wheels and ground: sim/skid_steering.h.
enum class FrictionLaw { kCone, kPyramid, kGazebo };
inline base::OneOf EnumNames(FrictionLaw) { return {"cone", "pyramid", "gazebo"}; }

/// The body and its drive.
struct RobotConfig {
  double length = 0.458;
  double width = 0.416;
  double mass = 16.523 + 4 * 0.477;
  double yaw_inertia = 0.554;
  double centre_of_mass_x = 0.01076;
  double centre_of_mass_y = 0.00179;
  double centre_of_mass_z = 0.1271;
  double sensor_mass = 0.0;
  double sensor_x = 0.12;
  double sensor_z = 0.3965;
  DriveKind drive = DriveKind::kSkidSteer;
  FrictionLaw friction = FrictionLaw::kCone;
  double wheel_base = 0.262;
  double track = 0.37559;
  double wheel_width = 0.04;
  double wheel_radius = 0.098;
  double wheel_separation_multiplier = 1.5;
  double wheel_friction = 0.5;
  double control_rate = 50.0;
  double linear_speed_limit = 2.0;
  double angular_speed_limit = 4.0;
  double linear_acceleration = 20.0;
  double angular_acceleration = 25.0;
  double speed_gain = 1.0;
  double yaw_gain = 1.0;
  double wheel_imbalance = 0.0;
  double command_delay = 0.0;
  double command_jitter = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("length", length, base::Range{0.05, 2.0}, "m",
      "Length of the robot's outline, along the driving direction, wheels included.");
    v("width", width, base::Range{0.05, 2.0}, "m",
      "Width of the robot's outline, across the driving direction, wheels included.");
    v("mass", mass, base::Range{0.1, 1000.0}, "kg", "Mass of chassis and wheels.");
    v("yaw_inertia", yaw_inertia, base::Range{0.001, 1000.0}, "kg m^2",
      "Moment of inertia of chassis and wheels about the vertical through their centre of mass.");
    v("centre_of_mass_x", centre_of_mass_x, base::Range{-1.0, 1.0}, "m",
      "How far the centre of mass of chassis and wheels is ahead of the point midway between the "
      "wheels (skid-steer). It must lie where every wheel carries some weight.");
    v("centre_of_mass_y", centre_of_mass_y, base::Range{-1.0, 1.0}, "m",
      "How far it is to the left of that point (skid-steer).");
    v("centre_of_mass_z", centre_of_mass_z, base::Range{0.0, 1.0}, "m",
      "How high it is above the ground: braking and turning shift weight to the wheels ahead and "
      "outside (skid-steer). 0: loads do not change.");
    v("sensor_mass", sensor_mass, base::Range{0.0, 100.0}, "kg",
      "Mass of a range finder on top, which moves the centre of mass; 1.1 for an LMS1xx "
      "(skid-steer).");
    v("sensor_x", sensor_x, base::Range{-1.0, 1.0}, "m",
      "How far ahead of the point midway between the wheels that mass is (skid-steer).");
    v("sensor_z", sensor_z, base::Range{0.0, 2.0}, "m",
      "How high above the ground that mass is (skid-steer).");
    v("drive", drive,
      "How the wheels move the body: four wheels that slip, with dry friction (skid-steer), or "
      "without any slip (ideal).");
    v("friction", friction,
      "Law of the wheels' friction (skid-steer). cone: the same bound in all directions, as rubber "
      "has. pyramid: bounds along and across the wheel that do not know of each other. gazebo: as "
      "Gazebo's ODE computes it, a pyramid whose axes turn with the wheel, so that grip comes and "
      "goes twice in each turn of the wheel.");
    v("wheel_base", wheel_base, base::Range{0.01, 2.0}, "m",
      "Distance from the front axle to the rear axle (skid-steer).");
    v("track", track, base::Range{0.01, 2.0}, "m",
      "Distance between the middles of the left and the right wheels (skid-steer).");
    v("wheel_width", wheel_width, base::Range{0.0, 1.0}, "m",
      "Width of a wheel, which meets the ground at both its edges; below track (skid-steer).");
    v("wheel_radius", wheel_radius, base::Range{0.005, 1.0}, "m",
      "Radius of a wheel, which says how fast it turns (friction = \"gazebo\").");
    v("wheel_separation_multiplier", wheel_separation_multiplier, base::Range{0.5, 4.0}, "",
      "The drive's controller assumes a track this many times as wide, to compensate for slip "
      "(skid-steer).");
    v("wheel_friction", wheel_friction, base::Range{0.01, 10.0}, "",
      "Friction coefficient of wheels on the ground (skid-steer).");
    v("control_rate", control_rate, base::Range{10.0, 1000.0}, "Hz",
      "Rate of the drive's velocity controller and of the rigid-body steps. Its product with "
      "episode.step must be a whole number.");
    v("linear_speed_limit", linear_speed_limit, base::Range{0.0, 5.0}, "m/s",
      "Largest speed that the drive takes, forwards and backwards; it clips commands to this.");
    v("angular_speed_limit", angular_speed_limit, base::Range{0.0, 10.0}, "rad/s",
      "Largest turn rate that the drive takes, left and right; it clips commands to this.");
    v("linear_acceleration", linear_acceleration, base::Range{0.1, 1000.0}, "m/s^2",
      "Largest change of the wheels' forward speed, speeding up and braking.");
    v("angular_acceleration", angular_acceleration, base::Range{0.1, 1000.0}, "rad/s^2",
      "Largest change of the turn rate demanded of the wheels.");
    v("speed_gain", speed_gain, base::Range{0.1, 2.0}, "",
      "Factor from the commanded forward speed to the speed demanded of the wheels. Worn tyres, "
      "for example, have less than 1.");
    v("yaw_gain", yaw_gain, base::Range{0.1, 2.0}, "",
      "Factor from the commanded turn rate to the turn rate demanded of the wheels.");
    v("wheel_imbalance", wheel_imbalance, base::Range{-0.5, 0.5}, "",
      "Fraction by which the right wheels run faster than the left ones, as larger wheels would "
      "(skid-steer).");
    v("command_delay", command_delay, base::Range{0.0, 1.0}, "s",
      "Time from the choice of an action until the drive acts on it; rounded to a multiple of 1 / "
      "control_rate.");
    v("command_jitter", command_jitter, base::Range{0.0, 1.0}, "s",
      "Largest additional delay of a command, drawn uniformly for each. A command never overtakes "
      "the one before it.");
  }
};

/// The range finder.
struct LidarConfig {
  static constexpr int kMaxBeams = 4096;

  int num_beams = 720;
  double field_of_view = 4.71238;
  double offset_x = 0.12;
  double offset_y = 0.0;
  double min_range = 0.1;
  double max_range = 30.0;
  double resolution = 0.01;
  double noise_std = 0.001;
  double noise_per_metre = 0.0;
  double dropout_probability = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("num_beams", num_beams, base::Range{2, kMaxBeams}, "", "Beams per scan.");
    v("field_of_view", field_of_view, base::Range{0.01, 6.2831}, "rad",
      "Arc from the first beam to the last, both included, centred on the driving direction.");
    v("offset_x", offset_x, base::Range{-2.0, 2.0}, "m",
      "How far ahead of the robot's centre the sensor is mounted.");
    v("offset_y", offset_y, base::Range{-2.0, 2.0}, "m",
      "How far to the left of the robot's centre the sensor is mounted.");
    v("min_range", min_range, base::Range{0.0, 10.0}, "m",
      "Smallest range that is reported; shorter ones are reported as this.");
    v("max_range", max_range, base::Range{0.1, 600.0}, "m",
      "Range reported if nothing is hit; the observation clips it further.");
    v("resolution", resolution, base::Range{0.01, 1.0}, "m",
      "Ranges are rounded to a multiple of this, and stored in centimetres.");
    v("noise_std", noise_std, base::Range{0.0, 1.0}, "m",
      "Standard deviation of the Gaussian noise of each range.");
    v("noise_per_metre", noise_per_metre, base::Range{0.0, 0.1}, "",
      "Increase of that standard deviation per metre of range.");
    v("dropout_probability", dropout_probability, base::Range{0.0, 1.0}, "",
      "Probability that a beam returns no echo and reports max_range.");
  }
};

/// The largest age of observed speeds, [s].
inline constexpr double kMaxSpeedDelay = 2.0;

/// How the robot estimates its pose, and the random walks by which that belief drifts from the
/// truth at each step.
struct LocalisationConfig {
  bool from_wheels = false;
  double position_drift = 0.0;
  double heading_drift = 0.0;
  double turn_drift = 0.0;
  double speed_noise = 0.0;
  double turn_rate_noise = 0.0;
  double speed_delay = 0.0;
  bool decides_arrival = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("from_wheels", from_wheels,
      "The robot reckons its position from its heading and from the speed at which its wheels "
      "roll, which follows the command, so that slip puts the position wrong. If not, slip is "
      "known.");
    v("position_drift", position_drift, base::Range{0.0, 1.0}, "m/m^0.5",
      "Standard deviation of the position error, along each axis, after a metre driven.");
    v("heading_drift", heading_drift, base::Range{0.0, 1.0}, "rad/m^0.5",
      "Standard deviation of the heading error after a metre driven.");
    v("turn_drift", turn_drift, base::Range{0.0, 1.0}, "rad/rad^0.5",
      "Standard deviation of the heading error after a radian turned.");
    v("speed_noise", speed_noise, base::Range{0.0, 5.0}, "m/s",
      "Standard deviation of the observed forward speed (environment.observation.speeds).");
    v("turn_rate_noise", turn_rate_noise, base::Range{0.0, 10.0}, "rad/s",
      "Standard deviation of the observed turn rate.");
    v("speed_delay", speed_delay, base::Range{0.0, kMaxSpeedDelay}, "s",
      "Age of the observed forward speed and turn rate. Between the ends of two control steps they "
      "are interpolated.");
    v("decides_arrival", decides_arrival,
      "The goal counts as reached when the robot believes that it is there, as one would stop that "
      "nobody watches. If not, when it is there.");
  }
};

/// What the networks see, and how.
struct ObservationConfig : env::StateOptions {
  double range_clip = 5.0;
  double goal_scale = 5.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("range_clip", range_clip, base::Range{0.5, 600.0}, "m",
      "Longer ranges are observed as this.");
    v("goal_scale", goal_scale, base::Range{0.1, 1000.0}, "m",
      "A goal coordinate g is observed as g / goal_scale - 1.");
    StateOptions::Visit(v);
  }
};

/// Equation 1 of the paper (Xu et al., section III-C).
struct RewardConfig {
  double success = 20.0;
  double progress = 1.0;
  double collision = 4.0;
  double slack = 0.0;
  double timeout = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("success", success, base::Range{0.0, 1000.0}, "", "Added when the goal is reached.");
    v("progress", progress, base::Range{0.0, 1000.0}, "1/m",
      "Added per metre by which the straight line to the goal became shorter.");
    v("collision", collision, base::Range{0.0, 1000.0}, "",
      "Subtracted at each control step with a collision (the paper: 4; its published code: 1).");
    v("slack", slack, base::Range{0.0, 1000.0}, "", "Subtracted every step.");
    v("timeout", timeout, base::Range{0.0, 1000.0}, "",
      "Subtracted when the step limit ends the episode.");
  }
};

/// Clock, start and end of an episode.
struct EpisodeConfig {
  double step = 0.2;
  int max_steps = 400;
  double goal_tolerance = 0.4;
  bool collision_ends = true;
  double finish_ahead = 0.0;
  double look_period = 0.0;
  double start_position_jitter = 0.0;
  double start_yaw_jitter = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("step", step, base::Range{0.005, 2.0}, "s",
      "Control step: simulated time for which an action is held.");
    v("max_steps", max_steps, base::Range{1, 1000000}, "",
      "Control steps after which the episode ends. Reaching this limit is a truncation, not a "
      "terminal state: learning counts the value of what would come after it.");
    v("goal_tolerance", goal_tolerance, base::Range{0.01, 10.0}, "m",
      "The goal counts as reached at a distance below this.");
    v("collision_ends", collision_ends,
      "Whether a contact ends the episode. If not, the contact costs reward at each control step "
      "that it lasts.");
    v("finish_ahead", finish_ahead, base::Range{0.0, 1000.0}, "m",
      "The episode also succeeds when the robot is this far ahead of the course's start, along the "
      "start's heading. 0: only at the goal.");
    v("look_period", look_period, base::Range{0.0, 1000.0}, "s",
      "Success is looked for once in this time, at the step that completes it. 0: at each step.");
    v("start_position_jitter", start_position_jitter, base::Range{0.0, 1.0}, "m",
      "The start is shifted by up to this along x and along y, uniformly at random.");
    v("start_yaw_jitter", start_yaw_jitter, base::Range{0.0, 3.1416}, "rad",
      "The start heading is turned by up to this to either side, uniformly at random.");
  }
};

/// The whole task: robot, sensor, observation, action, reward and episode.
struct EnvironmentConfig {
  RobotConfig robot;
  LidarConfig lidar;
  LocalisationConfig localisation;
  env::ActionBounds action;
  ObservationConfig observation;
  RewardConfig reward;
  EpisodeConfig episode;
  /// Fields drawn for each episode: sim/randomized_config.h.
  base::TomlAssignments randomize;
  /// Share of the episodes for which they are drawn; in the others they have their own values.
  double randomize_share = 1.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("randomize", randomize,
      "Fields below [environment] that are drawn for each episode from its seed, for example "
      "`{ robot.command_delay = [0.0, 0.12], robot.friction = [\"cone\", \"gazebo\"] }`: a number "
      "uniformly from a range, a name or a boolean from a list (docs/simulator.md). Setting such a "
      "field in a later file or by --set takes it out; `{}` takes out all.");
    v("randomize_share", randomize_share, base::Range{0.0, 1.0}, "",
      "Share of the episodes, by chance, in which the fields of `randomize` are drawn. In the "
      "others they have the values that [environment] gives them, which must be among those that "
      "are drawn.");
    v.Section("robot", robot, "The robot's body and drive.");
    v.Section("lidar", lidar, "The range finder.");
    v.Section("localisation", localisation,
              "Drift of the odometry and, with it, of the observed goal.");
    v.Section("action", action, "What an action means.");
    v.Section("observation", observation, "How the networks see the scan and the goal.");
    v.Section("reward", reward, "Reward of a step.");
    v.Section("episode", episode, "Clock, start and end of an episode.");
  }
};

/// Throws `base::Error` if fields contradict each other, or values that may be drawn for them do,
/// or as `RandomizedConfig` does. base/config.h checks single fields.
void CheckConsistent(const EnvironmentConfig& config);

/// How frames of this task become observations.
env::ObservationSpec MakeObservationSpec(const EnvironmentConfig& config);

/// Rigid-body steps in a control step, episode.step * robot.control_rate.
int NumSubsteps(const EnvironmentConfig& config);

}  // namespace slalom::sim
