#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "base/progress.h"
#include "eval/comparison/printers.h"

namespace slalom::eval {
namespace {

/// "500k", "500k + 12.5M imagined"
std::string StepsText(const TrainingFigures& training) {
  if (!training.steps) return "–";
  std::string text = base::FormatCount(*training.steps);
  if (training.imagined) {
    text += fmt::format(" + {} imagined", base::FormatCount(*training.imagined));
  }
  return text;
}

}  // namespace

const std::string_view kFiguresLegend =
    "In brackets 95 % intervals for further courses of the same kind, by a bootstrap over courses "
    "and, where an agent has several, seeds (Wilson's where resampling a rate shows no spread). "
    "IQM is the mean of the middle half of all success rates by seed and course, and *worst 5 %* "
    "that of the lowest twentieth. Survival is the time of failed episodes, traversal that of "
    "successful ones.";

const std::string_view kPairLegend =
    "Differences are the first agent minus the second. p-values are of permutation tests of "
    "success, corrected by Holm for the number of pairs: over courses for these policies, over "
    "trainings for the two ways to train. The verdict is that of the trainings, or that of the "
    "courses where nothing was trained. First better is the chance that a policy of the first "
    "has more success on a course; draws count half.";

std::string TitleOf(const Quantity& quantity, bool is_difference) {
  const std::string_view unit = is_difference ? quantity.difference_unit() : quantity.unit;
  return unit.empty() ? std::string(quantity.title) : fmt::format("{} [{}]", quantity.title, unit);
}

std::string SeedsText(const AgentFigures& agent) {
  if (agent.num_seeds != agent.num_planned) {
    return fmt::format("**{} of {}**", agent.num_seeds, agent.num_planned);
  }
  return agent.is_trained || agent.num_seeds > 1 ? fmt::format("{}", agent.num_seeds) : "–";
}

MarkdownTable FiguresTable(std::span<const AgentFigures> agents,
                           std::span<const std::size_t> columns) {
  MarkdownTable table{.titles = {"agent", "seeds", "episodes"}};
  for (const std::size_t q : columns) table.titles.push_back(TitleOf(Quantities()[q]));
  const bool has_trainings = std::ranges::any_of(
      agents, [](const AgentFigures& agent) { return agent.training.has_value(); });
  if (has_trainings) table.titles.insert(table.titles.end(), {"steps", "training"});
  for (const AgentFigures& agent : agents) {
    std::vector<std::string>& row = table.rows.emplace_back();
    row = {EscapeMarkdown(agent.label), SeedsText(agent), fmt::format("{}", agent.num_episodes)};
    for (const std::size_t q : columns) {
      const Quantity& quantity = Quantities()[q];
      row.push_back(EstimateText(agent.quantities[q].estimate, quantity.factor, quantity.digits));
    }
    if (!has_trainings) continue;
    const TrainingFigures training = agent.training.value_or(TrainingFigures{});
    row.push_back(StepsText(training));
    row.push_back(training.training_s ? base::FormatDuration(*training.training_s) : "–");
  }
  return table;
}

MarkdownTable PairTable(const Group& group) {
  MarkdownTable table{.titles = {"first", "second", "difference [points]", "p of these policies",
                                 "p of the trainings", "verdict", "first better [%]"},
                      .num_names = 2};
  for (const AgentPair& pair : group.pairs) {
    table.rows.push_back(
        {EscapeMarkdown(group.agents[pair.first].label),
         EscapeMarkdown(group.agents[pair.second].label),
         EstimateText(pair.difference(), 100.0, 1, true), PValueText(pair.corrected_p_value),
         PValueText(pair.corrected_training_p_value), std::string(ToString(pair.verdict)),
         EstimateText(pair.improvement, 100.0, 1)});
  }
  return table;
}

MarkdownTable DifferenceTable(const Group& group) {
  MarkdownTable table{.titles = {"first", "second"}, .num_names = 2};
  std::vector<std::size_t> columns;
  for (const std::size_t q : group.columns) {
    if (q == 0 || Quantities()[q].aggregate != Aggregate::kMean) continue;
    columns.push_back(q);
    table.titles.push_back(TitleOf(Quantities()[q], true));
  }
  for (const AgentPair& pair : group.pairs) {
    std::vector<std::string>& row = table.rows.emplace_back();
    row = {EscapeMarkdown(group.agents[pair.first].label),
           EscapeMarkdown(group.agents[pair.second].label)};
    for (const std::size_t q : columns) {
      const Quantity& quantity = Quantities()[q];
      row.push_back(EstimateText(pair.differences[q], quantity.factor, quantity.digits, true));
    }
  }
  return table;
}

std::string MarkdownOf(std::span<const Group> groups) {
  std::string text = fmt::format("# Evaluations\n\n{} {}\n",
                                 EscapeMarkdown(groups.front().protocol), kFiguresLegend);
  const auto out = std::back_inserter(text);
  bool has_pairs = false;
  for (const Group& group : groups) {
    fmt::format_to(out, "\n## {}\n\n{} course{}.\n\n{}", EscapeMarkdown(group.title),
                   group.num_courses, group.num_courses == 1 ? "" : "s",
                   FiguresTable(group.agents, group.columns).Print());
    if (!group.pairs.empty()) {
      fmt::format_to(out, "\n{}{}\n{}", has_pairs ? "" : std::string(kPairLegend) + "\n\n",
                     PairTable(group).Print(), DifferenceTable(group).Print());
      has_pairs = true;
    }
    for (const std::string& note : group.notes) fmt::format_to(out, "\n{}\n", EscapeMarkdown(note));
    std::vector<std::string> labels;
    for (const AgentFigures& agent : group.agents) labels.push_back(agent.label);
    text += MarkdownOf(group.drawn, labels, 3);
    text += MarkdownOf(group.settings, 3);
  }
  return text;
}

}  // namespace slalom::eval
