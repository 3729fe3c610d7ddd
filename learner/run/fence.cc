#include "learner/run/fence.h"

#include <stdlib.h>

#include <utility>

#include "base/error.h"
#include "base/file.h"

namespace slalom::run {

Fence::Fence(std::filesystem::path file)
    : file_(std::move(file)), content_(base::ReadFile(file_)) {}

Fence Fence::OfEnvironment() {
  const char* const file = ::getenv(kVariable);
  return file == nullptr ? Fence() : Fence(file);
}

bool Fence::IsHeld() const {
  if (file_.empty()) return true;
  try {
    return base::Exists(file_) && base::ReadFile(file_) == content_;
  } catch (const base::Error&) {
    return true;
  }
}

void Fence::RequireHeld() const {
  if (IsHeld()) return;
  throw base::Error(
      "{}: is gone or another's, so another worker trains here; nothing more is written",
      file_.string());
}

}  // namespace slalom::run
