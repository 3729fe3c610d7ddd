#include "eval/report/embedded_page.h"

#include <nlohmann/json.hpp>

#include "base/check.h"

namespace slalom::eval {
namespace {

void Replace(std::string& text, std::string_view mark, std::string_view content) {
  const std::size_t at = text.find(mark);
  SLALOM_CHECK(at != std::string::npos);
  text.replace(at, mark.size(), content);
}

}  // namespace

std::string JsonForPage(const nlohmann::json& json) {
  std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

std::string FillPage(std::string_view html, std::string_view style, std::string_view script,
                     std::string_view data) {
  std::string page(html);
  Replace(page, "/*STYLE*/", style);
  Replace(page, "/*SCRIPT*/", script);
  Replace(page, "/*DATA*/", data);
  return page;
}

}  // namespace slalom::eval
