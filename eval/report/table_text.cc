#include "eval/report/table_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace slalom::eval {
namespace {

/// `FixedText` with a sign above zero, too, if that is asked for.
std::string NumberText(double value, int digits, bool with_sign) {
  std::string text = FixedText(value, digits);
  const bool is_zero = text.find_first_not_of("0.") == std::string::npos;
  return with_sign && value > 0.0 && !is_zero ? "+" + text : text;
}

/// How many characters a terminal shows for a UTF-8 text.
std::size_t WidthOf(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }));
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

std::string MarkdownTable::PrintAligned() const {
  std::vector<std::size_t> widths(titles.size(), 0);
  const auto widen = [&](const std::vector<std::string>& cells) {
    for (std::size_t c = 0; c < cells.size(); ++c) {
      widths[c] = std::max(widths[c], WidthOf(cells[c]));
    }
  };
  widen(titles);
  for (const std::vector<std::string>& row : rows) widen(row);
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      text += "| " + cells[c] + std::string(widths[c] - WidthOf(cells[c]) + 1, ' ');
    }
    return text + "|\n";
  };
  std::string text = line(titles);
  for (const std::size_t width : widths) text += "|" + std::string(width + 2, '-');
  text += "|\n";
  for (const std::vector<std::string>& row : rows) text += line(row);
  return text;
}

std::string CsvEstimate(const std::optional<Estimate>& estimate) {
  if (!estimate) return ",,";
  if (!estimate->interval) return fmt::format("{:.6f},,", estimate->value);
  return fmt::format("{:.6f},{:.6f},{:.6f}", estimate->value, estimate->interval->low,
                     estimate->interval->high);
}

std::string EscapeMarkdown(std::string_view text) {
  constexpr std::string_view kSpecial = "\\|`*_[]<>#";
  std::string escaped;
  for (const char c : text) {
    if (kSpecial.find(c) != std::string_view::npos) escaped += '\\';
    escaped += c == '\n' || c == '\r' ? ' ' : c;
  }
  return escaped;
}

std::string MarkdownCode(std::string_view text) {
  const bool is_safe = !text.empty() && text.find_first_of("`|\\\r\n") == std::string_view::npos;
  return is_safe ? fmt::format("`{}`", text) : EscapeMarkdown(text);
}

}  // namespace slalom::eval
