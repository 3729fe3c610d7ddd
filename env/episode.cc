#include "env/episode.h"

#include "base/check.h"

namespace slalom::env {

std::string_view ToString(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRunning:
      return "running";
    case Outcome::kSuccess:
      return "success";
    case Outcome::kCollision:
      return "collision";
    case Outcome::kTimeout:
      return "timeout";
    case Outcome::kTerminated:
      return "terminated";
  }
  base::CheckFailed(__FILE__, __LINE__, "unknown outcome");
}

}  // namespace slalom::env
