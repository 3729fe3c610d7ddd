#include "proto/refusal_log.h"

#include <fmt/format.h>

#include <string>

#include "base/log.h"

namespace slalom::service {

void RefusalLog::Note(std::string_view server, std::string_view who, proto::RefusalCode code,
                      std::string_view text, Time now) {
  const auto [it, is_first] = said_.try_emplace(code);
  Said& said = it->second;
  if (!is_first && now - said.at < std::chrono::minutes(1)) {
    ++said.unsaid;
    return;
  }
  const std::string more =
      said.unsaid > 0 ? fmt::format("; {} more like it since the last line", said.unsaid) : "";
  spdlog::warn("{}: {} is refused ({}): {}{}", server, who, proto::ToString(code), text, more);
  said = {.at = now, .unsaid = 0};
}

}  // namespace slalom::service
