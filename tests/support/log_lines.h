#pragma once

#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace slalom::test {

/// Keeps what is logged while it exists. Make it before the threads that log.
class LogLines {
 public:
  LogLines() { spdlog::default_logger()->sinks().push_back(sink_); }
  ~LogLines() { std::erase(spdlog::default_logger()->sinks(), spdlog::sink_ptr(sink_)); }
  LogLines(const LogLines&) = delete;
  LogLines& operator=(const LogLines&) = delete;

  bool Has(const std::string& text) const { return sink_->Has(text); }
  /// Returns once a line with this text has come; the test's time limit ends it otherwise.
  void WaitFor(const std::string& text) const {
    while (!Has(text)) std::this_thread::yield();
  }

 private:
  class Sink : public spdlog::sinks::base_sink<std::mutex> {
   public:
    bool Has(const std::string& text) {
      const std::lock_guard lock(mutex_);
      return std::ranges::any_of(
          lines_, [&](const std::string& line) { return line.find(text) != std::string::npos; });
    }

   protected:
    void sink_it_(const spdlog::details::log_msg& message) override {
      lines_.emplace_back(message.payload.data(), message.payload.size());
    }
    void flush_() override {}

   private:
    std::vector<std::string> lines_;
  };

  const std::shared_ptr<Sink> sink_ = std::make_shared<Sink>();
};

}  // namespace slalom::test
