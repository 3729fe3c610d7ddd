#include "proto/refusal_log.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <sstream>

namespace slalom::service {
namespace {

TEST(RefusalLogTest, EachCodeIsSaidOnceAMinuteWithTheNumberOfTheOthers) {
  std::ostringstream said;
  const auto before = spdlog::default_logger();
  const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(said);
  sink->set_pattern("%v");
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  RefusalLog log;
  const RefusalLog::Time begin{};
  const auto note = [&](int second, proto::RefusalCode code) {
    log.Note("server", "actor a", code, "why", begin + std::chrono::seconds(second));
  };
  note(0, proto::RefusalCode::kTooFast);
  note(1, proto::RefusalCode::kTooFast);
  note(2, proto::RefusalCode::kNoSession);
  note(59, proto::RefusalCode::kTooFast);
  note(60, proto::RefusalCode::kTooFast);
  note(120, proto::RefusalCode::kTooFast);
  spdlog::set_default_logger(before);
  EXPECT_EQ(said.str(),
            "server: actor a is refused (too_fast): why\n"
            "server: actor a is refused (no_session): why\n"
            "server: actor a is refused (too_fast): why; 2 more like it since the last line\n"
            "server: actor a is refused (too_fast): why\n");
}

}  // namespace
}  // namespace slalom::service
