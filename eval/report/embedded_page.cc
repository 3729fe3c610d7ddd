#include "eval/report/embedded_page.h"

#include <nlohmann/json.hpp>

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

}  // namespace slalom::eval
