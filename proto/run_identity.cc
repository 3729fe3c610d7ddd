#include "proto/run_identity.h"

#include <fmt/format.h>

#include <set>
#include <sstream>
#include <string_view>

namespace slalom::proto {
namespace {

constexpr int kMaxNamed = 5;

std::string ValueOf(const RunIdentity& identity, const std::string& key) {
  const auto it = identity.find(key);
  return it == identity.end() ? "the default" : it->second;
}

constexpr std::string_view kIs = " = ";

}  // namespace

std::string PrintIdentity(const RunIdentity& identity) {
  std::string text;
  for (const auto& [key, value] : identity) text += fmt::format("{}{}{}\n", key, kIs, value);
  return text;
}

RunIdentity ParseIdentity(const std::string& text) {
  RunIdentity identity;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t is = line.find(kIs);
    if (is != std::string::npos) identity[line.substr(0, is)] = line.substr(is + kIs.size());
  }
  return identity;
}

std::string DescribeDifference(const RunIdentity& found, const RunIdentity& expected) {
  std::set<std::string> keys;
  for (const auto& [key, value] : found) keys.insert(key);
  for (const auto& [key, value] : expected) keys.insert(key);
  std::string text;
  int count = 0;
  for (const std::string& key : keys) {
    const std::string is = ValueOf(found, key);
    const std::string should = ValueOf(expected, key);
    if (is == should) continue;
    if (++count > kMaxNamed) continue;
    text += fmt::format("{}{} is {}, expected {}", text.empty() ? "" : "; ", key, is, should);
  }
  if (count > kMaxNamed) text += fmt::format("; and {} more", count - kMaxNamed);
  return text;
}

}  // namespace slalom::proto
