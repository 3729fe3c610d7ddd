#include "eval/report/agent_comparison_text.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <string_view>
#include <vector>

#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

/// A column of the table of agents.
struct AgentColumn {
  std::string_view title;
  std::string_view unit;
  std::string_view key;  // Of the CSV.
  double factor;         // From the figure to what is shown.
  std::optional<Estimate> (*figure)(const AgentFigures& agent);
};

constexpr std::array<AgentColumn, 4> kAgentColumns = {{
    {"success", "%", "success_rate", 100.0,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.success_rate; }},
    {"success, IQM", "%", "success_rate_iqm", 100.0,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.interquartile_success; }},
    {"collision", "%", "collision_rate", 100.0,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.collision_rate; }},
    {"traversal", "s", "traversal_time_s", 1.0,
     [](const AgentFigures& a) { return a.traversal_time; }},
}};

/// How a form writes what the forms write differently.
struct Form {
  std::string_view dash;
  std::string_view percent;
  std::string_view less;
  std::string_view minus;
};

constexpr Form kMarkdown{"–", "%", "\\<", "-"};
constexpr Form kLatex{"--", "\\%", "$<$", "$-$"};

/// "93.5 (90.1-96.0)". `with_sign`: a sign stands before what is more than 0.
std::string CellText(const std::optional<Estimate>& estimate, double factor, const Form& form,
                     bool with_sign = false) {
  if (!estimate) return std::string(form.dash);
  const auto number = [&](double value) {
    const double shown = factor * value;
    std::string digits = fmt::format("{:.1f}", std::abs(shown));
    if (digits == "0.0") return digits;  // Of neither sign.
    return fmt::format("{}{}", shown < 0.0 ? form.minus : with_sign ? "+" : "", digits);
  };
  std::string text = number(estimate->value);
  if (!estimate->interval) return text;
  return fmt::format("{} ({}{}{})", text, number(estimate->interval->low),
                     with_sign ? " to " : form.dash, number(estimate->interval->high));
}

std::string PValueText(const std::optional<double>& p, const Form& form) {
  if (!p) return std::string(form.dash);
  return *p < 0.001 ? fmt::format("{} 0.001", form.less) : fmt::format("{:.3f}", *p);
}

/// The cells of a pair after the two names.
std::vector<std::string> PairCells(const AgentPair& pair, const Form& form) {
  return {CellText(pair.test.difference, 100.0, form, true),
          CellText(pair.improvement, 100.0, form),
          PValueText(pair.test.p_value, form),
          PValueText(pair.corrected_p_value, form),
          PValueText(pair.test.training_p_value, form),
          PValueText(pair.corrected_training_p_value, form)};
}

constexpr std::array<std::string_view, 6> kPairTitles = {"difference [points]", "first better [%]",
                                                         "p of these policies", "corrected",
                                                         "p of the trainings",  "corrected"};

/// What the columns mean, below the tables.
constexpr std::string_view kLegend =
    "In brackets 95 % bootstrap intervals over courses and, where an agent has several, seeds. IQM "
    "is the interquartile mean. The difference is of success, the first agent minus the second. "
    "First better is the chance that a policy of the first scores higher on a course; draws "
    "count half. p of these policies is that of flipping signs of the courses' differences, and p "
    "of the trainings that of relabelling the seeds. Corrected is after Holm, for the number "
    "of pairs.";

std::string CourseCount(const AgentComparison& comparison) {
  return fmt::format("{} course{}", comparison.num_courses, comparison.num_courses == 1 ? "" : "s");
}

std::string CsvNumber(const std::optional<double>& number) {
  return number ? fmt::format("{:.6f}", *number) : "";
}

std::string CsvLine(const std::string& agent, const std::string& against, std::string_view quantity,
                    const std::optional<double>& threshold,
                    const std::optional<Estimate>& estimate) {
  std::string line = fmt::format("{},{},{},{},", CsvField(agent), CsvField(against), quantity,
                                 CsvNumber(threshold));
  if (!estimate) return line + ",,\n";
  line += CsvNumber(estimate->value) + ",";
  if (!estimate->interval) return line + ",\n";
  return line + fmt::format("{:.6f},{:.6f}\n", estimate->interval->low, estimate->interval->high);
}

std::optional<Estimate> Plain(const std::optional<double>& value) {
  if (!value) return std::nullopt;
  return Estimate{*value, std::nullopt};
}

}  // namespace

std::string MarkdownOf(const AgentComparison& comparison) {
  std::string text =
      fmt::format("# Agents on {}\n\n{}. {}\n\n| agent | seeds |", EscapeMarkdown(comparison.title),
                  CourseCount(comparison), EscapeMarkdown(comparison.protocol));
  auto out = std::back_inserter(text);
  for (const AgentColumn& column : kAgentColumns) {
    fmt::format_to(out, " {} [{}] |", column.title, column.unit);
  }
  text += "\n|---|---:|---:|---:|---:|---:|\n";
  for (const AgentFigures& agent : comparison.agents) {
    fmt::format_to(out, "| {} | {} |", EscapeMarkdown(agent.label), agent.num_seeds);
    for (const AgentColumn& column : kAgentColumns) {
      fmt::format_to(out, " {} |", CellText(column.figure(agent), column.factor, kMarkdown));
    }
    text += '\n';
  }
  if (!comparison.pairs.empty()) {
    text += "\n| first | second |";
    for (const std::string_view title : kPairTitles) fmt::format_to(out, " {} |", title);
    text += "\n|---|---|---:|---:|---:|---:|---:|---:|\n";
    for (const AgentPair& pair : comparison.pairs) {
      fmt::format_to(out, "| {} | {} |", EscapeMarkdown(comparison.agents[pair.first].label),
                     EscapeMarkdown(comparison.agents[pair.second].label));
      for (const std::string& cell : PairCells(pair, kMarkdown)) {
        fmt::format_to(out, " {} |", cell);
      }
      text += '\n';
    }
  }
  fmt::format_to(out, "\n{}\n", kLegend);
  for (const std::string& note : comparison.notes) {
    fmt::format_to(out, "\n{}\n", EscapeMarkdown(note));
  }
  return text;
}

std::string CsvOf(const AgentComparison& comparison) {
  std::string text = "agent,against,quantity,threshold,value,low,high\n";
  for (const AgentFigures& agent : comparison.agents) {
    text += CsvLine(agent.label, "", "seeds", {}, Estimate{double(agent.num_seeds), {}});
    for (const AgentColumn& column : kAgentColumns) {
      text += CsvLine(agent.label, "", column.key, {}, column.figure(agent));
    }
    for (std::size_t t = 0; t < agent.profile.size(); ++t) {
      text += CsvLine(agent.label, "", "share_of_success_rates_above", comparison.thresholds[t],
                      agent.profile[t]);
    }
  }
  for (const AgentPair& pair : comparison.pairs) {
    const auto add = [&](std::string_view quantity, const std::optional<Estimate>& estimate) {
      text += CsvLine(comparison.agents[pair.first].label, comparison.agents[pair.second].label,
                      quantity, {}, estimate);
    };
    add("success_rate_difference", pair.test.difference);
    add("probability_of_improvement", pair.improvement);
    add("p_value", Plain(pair.test.p_value));
    add("p_value_holm", Plain(pair.corrected_p_value));
    add("training_p_value", Plain(pair.test.training_p_value));
    add("training_p_value_holm", Plain(pair.corrected_training_p_value));
  }
  return text;
}

std::string LatexOf(const AgentComparison& comparison) {
  std::string text = "% Needs \\usepackage{booktabs}.\n";
  auto out = std::back_inserter(text);
  for (const std::string& note : comparison.notes) {
    fmt::format_to(out, "% {}\n", EscapeLatex(note));
  }
  fmt::format_to(out,
                 "\\begin{{table}}\n  \\centering\n  \\caption{{{}, {}. {}}}\n"
                 "  \\begin{{tabular}}{{lrrrrr}}\n    \\toprule\n    agent & seeds",
                 EscapeLatex(comparison.title), CourseCount(comparison),
                 EscapeLatex(comparison.protocol));
  for (const AgentColumn& column : kAgentColumns) {
    fmt::format_to(out, " & {} [{}]", column.title, column.unit == "%" ? kLatex.percent : "s");
  }
  text += " \\\\\n    \\midrule\n";
  for (const AgentFigures& agent : comparison.agents) {
    fmt::format_to(out, "    {} & {}", EscapeLatex(agent.label), agent.num_seeds);
    for (const AgentColumn& column : kAgentColumns) {
      fmt::format_to(out, " & {}", CellText(column.figure(agent), column.factor, kLatex));
    }
    text += " \\\\\n";
  }
  text += "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n";
  if (comparison.pairs.empty()) return text;
  fmt::format_to(out, "\n\\begin{{table}}\n  \\centering\n  \\caption{{{}}}\n",
                 EscapeLatex(kLegend));
  text += "  \\begin{tabular}{llrrrrrr}\n    \\toprule\n    first & second";
  for (const std::string_view title : kPairTitles) fmt::format_to(out, " & {}", EscapeLatex(title));
  text += " \\\\\n    \\midrule\n";
  for (const AgentPair& pair : comparison.pairs) {
    fmt::format_to(out, "    {} & {}", EscapeLatex(comparison.agents[pair.first].label),
                   EscapeLatex(comparison.agents[pair.second].label));
    for (const std::string& cell : PairCells(pair, kLatex)) fmt::format_to(out, " & {}", cell);
    text += " \\\\\n";
  }
  return text + "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n";
}

}  // namespace slalom::eval
