#include "eval/report/embedded_page.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/check.h"

namespace slalom::eval {
namespace {

constexpr std::string_view kMark = "/*DATA*/";

}  // namespace

std::string FillPage(std::string_view page, std::string_view data) {
  std::string text(page);
  const std::size_t at = text.rfind(kMark);
  SLALOM_CHECK(at != std::string::npos);
  return text.replace(at, kMark.size(), data);
}

std::string JsonForPage(const nlohmann::json& json) {
  std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

nlohmann::json JsonOf(const std::optional<Estimate>& estimate) {
  if (!estimate) return nullptr;
  if (!estimate->interval) return {estimate->value, nullptr, nullptr};
  return {estimate->value, estimate->interval->low, estimate->interval->high};
}

nlohmann::json JsonOf(const std::optional<double>& number) {
  return number ? nlohmann::json(*number) : nlohmann::json(nullptr);
}

namespace {

constexpr double kLargestInteger = 32000.0;

}  // namespace

std::string Base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < n ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= n ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return text;
}

PackedNumbers PackNumbers(std::span<const double> numbers, double resolution) {
  double largest = 0.0;
  for (const double number : numbers) largest = std::max(largest, std::abs(number));
  const double scale = std::max(resolution, largest / kLargestInteger);
  std::vector<std::uint8_t> bytes;
  bytes.reserve(2 * numbers.size());
  for (const double number : numbers) {
    const auto integer = static_cast<std::uint16_t>(std::lround(number / scale));
    bytes.push_back(static_cast<std::uint8_t>(integer & 255u));
    bytes.push_back(static_cast<std::uint8_t>(integer >> 8));
  }
  return {scale, Base64(bytes)};
}

}  // namespace slalom::eval
