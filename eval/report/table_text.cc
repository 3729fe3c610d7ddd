#include "eval/report/table_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

namespace slalom::eval {
namespace {

/// `text` with a backslash before each of `special`.
std::string Escape(std::string_view text, std::string_view special) {
  std::string escaped;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) escaped += '\\';
    escaped += c == '\n' || c == '\r' ? ' ' : c;
  }
  return escaped;
}

/// `FixedText` with a sign above zero, too, if that is asked for.
std::string NumberText(double value, int digits, bool with_sign) {
  std::string text = FixedText(value, digits);
  const bool is_zero = text.find_first_not_of("0.") == std::string::npos;
  return with_sign && value > 0.0 && !is_zero ? "+" + text : text;
}

}  // namespace

std::string FixedText(double value, int digits) {
  double scale = 1.0;
  for (int i = 0; i < digits; ++i) scale *= 10.0;
  double size = std::abs(value);
  // fmt rounds an exact half to the even digit; the product has no rounding error if it is one.
  const double scaled = size * scale;
  const bool is_half = scaled - std::floor(scaled) == 0.5 && std::fma(size, scale, -scaled) == 0.0;
  if (is_half) size = std::ceil(scaled) / scale;
  std::string text = fmt::format("{:.{}f}", size, digits);
  const bool is_zero = text.find_first_not_of("0.") == std::string::npos;
  return value < 0.0 && !is_zero ? "-" + text : text;
}

std::string EstimateText(const std::optional<Estimate>& estimate, double factor, int digits,
                         bool is_difference) {
  if (!estimate) return "–";
  const auto number = [&](double value) {
    return NumberText(factor * value, digits, is_difference);
  };
  if (!estimate->interval) return number(estimate->value);
  const auto [low, high] = *estimate->interval;
  return fmt::format("{} ({}{}{})", number(estimate->value), number(low),
                     is_difference || low < 0.0 ? " to " : "–", number(high));
}

std::string PValueText(const std::optional<double>& p) {
  if (!p) return "–";
  return *p < 0.001 ? "\\< 0.001" : fmt::format("{:.3f}", *p);
}

std::string MarkdownTable::Print() const {
  const auto line = [](const std::vector<std::string>& cells) {
    return fmt::format("| {} |\n", fmt::join(cells, " | "));
  };
  std::string text = line(titles) + "|";
  for (std::size_t c = 0; c < titles.size(); ++c) text += c < num_names ? "---|" : "---:|";
  text += '\n';
  for (const std::vector<std::string>& row : rows) text += line(row);
  return text;
}

std::string CsvEstimate(const std::optional<Estimate>& estimate) {
  if (!estimate) return ",,";
  if (!estimate->interval) return fmt::format("{:.6f},,", estimate->value);
  return fmt::format("{:.6f},{:.6f},{:.6f}", estimate->value, estimate->interval->low,
                     estimate->interval->high);
}

std::string EscapeMarkdown(std::string_view text) { return Escape(text, "\\|`*_[]<>#"); }

std::string MarkdownCode(std::string_view text) {
  const bool is_safe = !text.empty() && text.find_first_of("`|\\\r\n") == std::string_view::npos;
  return is_safe ? fmt::format("`{}`", text) : EscapeMarkdown(text);
}

std::string EscapeLatex(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '\\':
        escaped += "\\textbackslash{}";
        break;
      case '~':
        escaped += "\\textasciitilde{}";
        break;
      case '^':
        escaped += "\\textasciicircum{}";
        break;
      case '\n':
      case '\r':
        escaped += ' ';
        break;
      default:
        escaped += Escape(std::string_view(&c, 1), "&%$#_{}");
    }
  }
  return escaped;
}

}  // namespace slalom::eval
