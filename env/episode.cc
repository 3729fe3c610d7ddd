#include "env/episode.h"

#include <array>

namespace slalom::env {

std::string_view ToString(Outcome outcome) {
  constexpr std::array<std::string_view, 5> kNames = {"running", "success", "collision", "timeout",
                                                      "terminated"};
  return kNames.at(static_cast<std::size_t>(outcome));
}

}  // namespace slalom::env
