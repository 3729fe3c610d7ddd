#include "proto/run_identity.h"

#include <fmt/format.h>

#include <set>

namespace slalom::proto {
namespace {

constexpr int kMaxNamed = 5;

std::string ValueOf(const RunIdentity& identity, const std::string& key) {
  const auto it = identity.find(key);
  return it == identity.end() ? "the default" : it->second;
}

}  // namespace

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
