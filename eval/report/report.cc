#include "eval/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "eval/report/result.h"
#include "eval/report/table_text.h"
#include "sim/courses/course_file.h"
#include "sim/courses/episode_file.h"
#include "sim/randomized_config.h"

namespace slalom::eval {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr char kCoursesFile[] = "evaluation.courses";
constexpr char kTracksFile[] = "evaluation-tracks.jsonl";

// ---- Terminal
// -------------------------------------------------------------------------------------

std::string IntervalText(const std::optional<Interval>& interval, double factor, int digits,
                         std::string_view unit) {
  if (!interval) return "";
  return fmt::format("{} ... {}{}", FixedText(factor * interval->low, digits),
                     FixedText(factor * interval->high, digits), unit);
}

/// "  success          98.6 %     96.9 ... 99.4 %      493 of 500 episodes"
std::string Line(std::string_view name, const std::optional<Estimate>& estimate, double factor,
                 int digits, std::string_view unit, const std::string& remark) {
  if (!estimate) return fmt::format("  {:<16}{:>10}   {:<22}{}\n", name, "-", "", remark);
  const std::string value = FixedText(factor * estimate->value, digits) + std::string(unit);
  return fmt::format("  {:<16}{:>10}   {:<22}{}\n", name, value,
                     IntervalText(estimate->interval, factor, digits, unit), remark);
}

std::string SetLines(const Figures& set) {
  const int num_failures = set.num_episodes - set.num_successes;
  return Line("success", set.success_rate, 100, 1, " %",
              fmt::format("{} of {} episodes", set.num_successes, set.num_episodes)) +
         Line("collision", set.collision_rate, 100, 1, " %",
              fmt::format("{}", set.num_collisions)) +
         Line("timeout", set.timeout_rate, 100, 1, " %", fmt::format("{}", set.num_timeouts)) +
         Line("traversal time", set.traversal_time, 1, 2, " s",
              fmt::format("of the {} successful", set.num_successes)) +
         Line("survival time", set.survival_time, 1, 2, " s",
              fmt::format("of the {} failed", num_failures)) +
         Line("BARN score", set.barn_score, 1, 4, "", "at most 0.5");
}

/// Figures in other physics than Slalom's own say so.
std::string PhysicsLine(const sim::Physics& physics) {
  if (!physics.make_bodies) return "";
  return fmt::format("  physics {} {}\n", physics.name, physics.version);
}

/// Collisions that did not end their episodes.
std::string ContactLine(const Evaluation& evaluation) {
  if (evaluation.task.protocol.collision_ends) return "";
  const Figures& set = evaluation.summary.set;
  return Line("touched", set.contact_rate, 100, 1, " %",
              fmt::format("{} contacts, which end nothing here", set.num_contacts));
}

/// What a guard did.
std::string GuardLine(const Evaluation& evaluation) {
  std::int64_t num_changed = 0, num_actions = 0;
  int num_episodes = 0;
  for (const EpisodeRecord& record : evaluation.episodes.records) {
    num_changed += record.num_interventions;
    num_actions += record.num_steps;
    num_episodes += record.num_interventions > 0;
  }
  if (num_changed == 0) return "";
  return fmt::format("  {:<16}{:>10}   {:<22}changed, in {} episodes\n", "guard",
                     FixedText(100.0 * num_changed / num_actions, 1) + " %", "of the actions",
                     num_episodes);
}

/// A score on courses that were trained on says little; this line says so.
std::string OverlapLine(const Evaluation& evaluation) {
  const auto& overlap = evaluation.training_overlap;
  if (!overlap || overlap->num_courses == 0) return "";
  return fmt::format("  warning: {}\n", DescribeOverlap(*overlap));
}

/// The courses with failures, those with most of them first, in the set's order among equals.
std::vector<const CourseFigures*> CoursesWithFailures(const Summary& summary) {
  std::vector<const CourseFigures*> courses;
  for (const CourseFigures& course : summary.courses) {
    if (course.figures.num_successes < course.figures.num_episodes) courses.push_back(&course);
  }
  std::ranges::stable_sort(
      courses, {}, [](const CourseFigures* course) { return course->figures.success_rate.value; });
  return courses;
}

std::string CourseLines(const Summary& summary, int max_courses) {
  const auto courses = CoursesWithFailures(summary);
  if (courses.empty()) return "  every episode on every course succeeded\n";
  const auto num_shown = std::min<std::size_t>(courses.size(), std::max(0, max_courses));
  std::string text =
      fmt::format("  {} of {} courses with failures{}\n", courses.size(), summary.courses.size(),
                  num_shown < courses.size() ? "; the worst:" : ":");
  for (std::size_t k = 0; k < num_shown; ++k) {
    const Figures& figures = courses[k]->figures;
    fmt::format_to(std::back_inserter(text),
                   "    {:<28} {:>3} of {} succeeded, {} collided, {} timed out\n",
                   courses[k]->name, figures.num_successes, figures.num_episodes,
                   figures.num_collisions, figures.num_timeouts);
  }
  return text;
}

// ---- JSON
// -----------------------------------------------------------------------------------------

OrderedJson ToJson(const std::optional<Interval>& interval) {
  if (!interval) return nullptr;
  return {interval->low, interval->high};
}

void Put(OrderedJson& object, const std::string& name, const std::optional<Estimate>& estimate) {
  object[name] = estimate ? OrderedJson(estimate->value) : OrderedJson(nullptr);
  object[name + "_interval"] = estimate ? ToJson(estimate->interval) : OrderedJson(nullptr);
}

void PutFigures(OrderedJson& object, const Figures& figures) {
  object["episodes"] = figures.num_episodes;
  object["successes"] = figures.num_successes;
  object["collisions"] = figures.num_collisions;
  object["timeouts"] = figures.num_timeouts;
  Put(object, "success_rate", figures.success_rate);
  Put(object, "collision_rate", figures.collision_rate);
  Put(object, "timeout_rate", figures.timeout_rate);
  Put(object, "contact_rate", figures.contact_rate);
  object["contacts"] = figures.num_contacts;
  Put(object, "survival_time_s", figures.survival_time);
  Put(object, "traversal_time_s", figures.traversal_time);
  Put(object, "barn_score", figures.barn_score);
  Put(object, "barn_score_until_2024", figures.barn_score_until_2024);
  object["mean_return"] = figures.mean_return;
  object["mean_path_length_m"] = figures.mean_path_length;
}

OrderedJson ProtocolJson(const EvaluationTask& task) {
  const Protocol& protocol = task.protocol;
  const sim::EpisodeConfig& episode = task.environment.episode;
  OrderedJson json = {{"name", protocol.name},
                      {"time_limit_s", protocol.time_limit},
                      {"goal_tolerance_m", protocol.goal_tolerance},
                      {"collision_ends", protocol.collision_ends},
                      {"clock_start_distance_m", protocol.clock_start_distance},
                      {"start_shift_m", {protocol.start_shift_W.x, protocol.start_shift_W.y}},
                      {"start_position_jitter_m", episode.start_position_jitter},
                      {"start_yaw_jitter_rad", episode.start_yaw_jitter}};
  // Zeros are left out, so that earlier results of these protocols are comparable.
  for (const auto& [key, value] : {std::pair{"run_up_m", protocol.run_up},
                                   {"run_out_m", protocol.run_out},
                                   {"finish_ahead_m", protocol.finish_ahead},
                                   {"look_period_s", protocol.look_period}}) {
    if (value > 0.0) json[key] = value;
  }
  return json;
}

OrderedJson PhysicsOf(const sim::Physics& physics) {
  return {{"name", physics.name}, {"version", physics.version}};
}

OrderedJson RunJson(const Evaluation& evaluation) {
  return {{"episodes_per_course", evaluation.task.episodes_per_course},
          {"seed", evaluation.task.seed},
          {"step_s", evaluation.task.environment.episode.step},
          {"robot_length_m", evaluation.task.environment.robot.length},
          {"robot_width_m", evaluation.task.environment.robot.width},
          {"confidence", 0.95}};
}

OrderedJson OverlapJson(const std::optional<TrainingOverlap>& overlap) {
  if (!overlap) return nullptr;
  return {{"courses", overlap->num_courses},
          {"of", overlap->num_scored},
          {"trained_on", overlap->trained_on}};
}

OrderedJson ProvenanceJson(const Evaluation& evaluation, const Provenance& provenance) {
  return {{"source", provenance.source},
          {"profiles", provenance.profiles},
          {"course_set", provenance.course_set},
          {"collection", provenance.collection},
          {"training_overlap", OverlapJson(evaluation.training_overlap)},
          {"commit", provenance.commit},
          {"config", provenance.config}};
}

/// The randomised fields. Empty if there are none.
OrderedJson DrawnJson(std::span<const sim::RandomizedField> fields) {
  OrderedJson list = OrderedJson::array();
  for (const sim::RandomizedField& field : fields) {
    OrderedJson& json = list.emplace_back();
    json["key"] = field.key;
    if (field.names.empty()) {
      json["unit"] = field.unit;
      json["low"] = field.low;
      json["high"] = field.high;
    } else {
      json["names"] = field.names;
    }
  }
  return list;
}

/// How each episode of each course ended. [number of courses]
std::vector<OrderedJson> EpisodeLists(const Evaluation& evaluation,
                                      std::span<const sim::RandomizedField> drawn) {
  std::vector<OrderedJson> lists(evaluation.summary.courses.size());
  for (const EpisodeRecord& record : evaluation.episodes.records) {
    OrderedJson& course = lists[record.course];
    course["outcomes"].push_back(env::ToString(record.outcome));
    course["times_s"].push_back(record.time(evaluation.task.environment.episode.step));
    course["collisions_per_episode"].push_back(record.num_collisions);
    course["interventions_per_episode"].push_back(record.num_interventions);
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      OrderedJson& values = course["drawn"][drawn[i].key];
      if (drawn[i].names.empty()) {
        values.push_back(record.drawn[i]);
      } else {
        values.push_back(static_cast<int>(record.drawn[i]));
      }
    }
  }
  return lists;
}

/// A name that a course file may carry.
std::string FileSetName(const std::string& name) {
  std::string clean = name.substr(0, 100);
  for (char& c : clean) {
    if (!sim::IsCourseName(std::string("a") + c)) c = '-';
  }
  if (clean.empty() || clean.front() == '.') clean = "courses";
  return clean;
}

// ---- CSV
// ------------------------------------------------------------------------------------------

std::string TimeField(const std::optional<Estimate>& time) {
  return time ? fmt::format("{:.4f}", time->value) : "";
}

void Append(std::string& text, const Estimate& rate) {
  fmt::format_to(std::back_inserter(text), "{:.6f},{:.6f},{:.6f},", rate.value, rate.interval->low,
                 rate.interval->high);
}

}  // namespace

std::string TextReport(const Evaluation& evaluation, int max_courses) {
  const Summary& summary = evaluation.summary;
  const EvaluationTask& task = evaluation.task;
  const Protocol& protocol = task.protocol;
  const sim::EpisodeConfig& episode = task.environment.episode;
  return fmt::format(
             "{}: {} course{} x {} episode{}, seed {}, start within {} m and {} rad\n"
             "  protocol {}: {} s, goal within {} m{}, {}\n"
             "{}  {:<16}{:>10}   {}\n",
             evaluation.task.courses.name, summary.courses.size(),
             summary.courses.size() == 1 ? "" : "s", task.episodes_per_course,
             task.episodes_per_course == 1 ? "" : "s", task.seed, episode.start_position_jitter,
             episode.start_yaw_jitter, protocol.name, protocol.time_limit, protocol.goal_tolerance,
             protocol.finish_ahead > 0.0
                 ? fmt::format(" or {} m ahead of the start", protocol.finish_ahead)
                 : "",
             protocol.collision_ends ? "a collision ends the episode" : "collisions end nothing",
             PhysicsLine(task.physics), "", "", "95 % interval") +
         SetLines(summary.set) + ContactLine(evaluation) + GuardLine(evaluation) +
         OverlapLine(evaluation) + CourseLines(summary, max_courses);
}

std::string JsonReport(const Evaluation& evaluation, const Provenance& provenance) {
  OrderedJson report;
  report["format"] = "slalom-evaluation";
  report["version"] = kResultVersion;
  report["agent"] = {{"name", provenance.agent}, {"kind", provenance.kind}};
  report["course_set"] = evaluation.task.courses.name;
  PutFigures(report, evaluation.summary.set);
  report["protocol"] = ProtocolJson(evaluation.task);
  report["physics"] = PhysicsOf(evaluation.task.physics);
  report["run"] = RunJson(evaluation);
  report["provenance"] = ProvenanceJson(evaluation, provenance);
  report["files"] = {{"courses", kCoursesFile}, {"tracks", kTracksFile}};
  const sim::RandomizedConfig task(evaluation.task.environment);
  if (!task.fields().empty()) report["drawn"] = DrawnJson(task.fields());
  OrderedJson courses = OrderedJson::array();
  std::vector<OrderedJson> lists = EpisodeLists(evaluation, task.fields());
  for (const CourseFigures& course : evaluation.summary.courses) {
    OrderedJson object;
    object["course"] = course.name;
    object["optimal_time_s"] = course.optimal_time;
    PutFigures(object, course.figures);
    object.update(lists[course.course]);
    courses.push_back(std::move(object));
  }
  report["courses"] = std::move(courses);
  // A path need not be UTF-8; other bytes are replaced, not refused.
  return report.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

std::string CourseCsv(const Evaluation& evaluation) {
  std::string text =
      "course,episodes,successes,collisions,timeouts,success_rate,success_rate_low,success_rate_"
      "high,collision_rate,collision_rate_low,collision_rate_high,timeout_rate,timeout_rate_low,"
      "timeout_rate_high,contacts,survival_time_s,traversal_time_s,optimal_time_s,barn_score,mean_"
      "return,mean_path_length_m\n";
  for (const CourseFigures& course : evaluation.summary.courses) {
    const Figures& figures = course.figures;
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{},", course.name, figures.num_episodes,
                   figures.num_successes, figures.num_collisions, figures.num_timeouts);
    Append(text, figures.success_rate);
    Append(text, figures.collision_rate);
    Append(text, figures.timeout_rate);
    fmt::format_to(std::back_inserter(text), "{},{},{},{:.4f},{:.6f},{:.6f},{:.4f}\n",
                   figures.num_contacts, TimeField(figures.survival_time),
                   TimeField(figures.traversal_time), course.optimal_time, figures.barn_score.value,
                   figures.mean_return, figures.mean_path_length);
  }
  return text;
}

std::string EpisodeCsv(const Evaluation& evaluation) {
  std::string text =
      "course,episode,seed,outcome,steps,time_s,clock_start_s,collisions,path_length_m,min_range_m,"
      "return,barn_score,interventions,agent_status";
  const sim::RandomizedConfig task(evaluation.task.environment);
  for (const sim::RandomizedField& field : task.fields()) text += "," + field.key;
  text += '\n';
  const double step = evaluation.task.environment.episode.step;
  for (const EpisodeRecord& record : evaluation.episodes.records) {
    const CourseFigures& course = evaluation.summary.courses[record.course];
    const double time = record.time(step);
    fmt::format_to(std::back_inserter(text),
                   "{},{},{},{},{},{:.4f},{:.4f},{},{:.4f},{:.2f},{:.6f},{:.6f},{},{}", course.name,
                   record.episode, record.seed, env::ToString(record.outcome), record.num_steps,
                   time, record.clock_start_step * step, record.num_collisions, record.path_length,
                   record.min_range, record.episode_return,
                   BarnScore(record.outcome, time, course.optimal_time), record.num_interventions,
                   record.agent_status);
    for (std::size_t i = 0; i < record.drawn.size(); ++i) {
      const std::vector<std::string>& names = task.fields()[i].names;
      text += ',';
      text += names.empty() ? fmt::format("{}", record.drawn[i])
                            : names[static_cast<std::size_t>(record.drawn[i])];
    }
    text += '\n';
  }
  return text;
}

Result ResultOf(const Evaluation& evaluation, const Provenance& provenance) {
  Result result = ParseResult(JsonReport(evaluation, provenance), "this evaluation").result;
  result.course_set_data = evaluation.task.courses;
  return result;
}

void WriteReports(const Evaluation& evaluation, const Provenance& provenance,
                  const std::filesystem::path& directory) {
  base::MakeDirectories(directory);
  base::WriteFileAtomically(directory / "evaluation-courses.csv", CourseCsv(evaluation));
  base::WriteFileAtomically(directory / "evaluation-episodes.csv", EpisodeCsv(evaluation));
  sim::WriteEpisodes(directory / kTracksFile, evaluation.episodes.tracks);
  sim::WriteCourseSet(directory / kCoursesFile,
                      {FileSetName(evaluation.task.courses.name), evaluation.task.courses.courses});
  base::WriteFileAtomically(directory / kEvaluationFile, JsonReport(evaluation, provenance));
}

}  // namespace slalom::eval
