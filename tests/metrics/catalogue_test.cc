#include "metrics/catalogue.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <regex>
#include <set>

namespace slalom::metrics {
namespace {

std::vector<const Spec*> All() {
  std::vector<const Spec*> all;
  for (const CatalogueSection& section : Catalogue()) {
    all.insert(all.end(), section.specs.begin(), section.specs.end());
  }
  return all;
}

/// What Prometheus' conventions and our own say against a metric; empty: nothing.
std::string Fault(const Spec& spec) {
  const std::string name(spec.name);
  static const std::regex shape("(slalom|process)_[a-z]+(_[a-z0-9]+)*");
  if (!std::regex_match(name, shape)) return "its name has another form";
  if (name.ends_with("_total") != (spec.type == Type::kCounter)) {
    return "counters end in _total, and nothing else does";
  }
  // What the text format derives from a histogram, and units that are not the base ones.
  for (const char* word : {"_count", "_sum", "_bucket", "_ms", "_milliseconds", "_percent", "_mb",
                           "_kilobytes", "_minutes"}) {
    if (name.find(word) != std::string::npos) return std::string("its name holds ") + word;
  }
  if (spec.help.size() < 5 || !spec.help.ends_with('.')) return "its help is no sentence";
  if (spec.help.find('|') != std::string::npos) return "its help breaks the table";
  static const std::regex roles(
      "(all|sweep|(actor|replay|learner|evaluator)"
      "(, (actor|replay|learner|evaluator|train))*)");
  if (!std::regex_match(std::string(spec.roles), roles)) return "its roles are unknown";
  for (const std::string_view label : spec.labels) {
    static const std::regex word("[a-z]+(_[a-z]+)*");
    if (!std::regex_match(std::string(label), word)) return "a label has another form";
    for (const char* taken : {"run", "role", "name", "le", "job", "instance"}) {
      if (label == taken) return "a label is taken";
    }
  }
  if (spec.buckets.empty() != (spec.type != Type::kHistogram)) return "buckets are a histogram's";
  const bool rises = std::is_sorted(spec.buckets.begin(), spec.buckets.end(), std::less_equal<>());
  if (!rises) return "its buckets do not rise";
  return "";
}

TEST(CatalogueTest, EveryMetricFollowsTheConventions) {
  ASSERT_GE(All().size(), 80u);
  for (const Spec* spec : All()) EXPECT_EQ(Fault(*spec), "") << spec->name;
}

TEST(CatalogueTest, TheRulesSeeWhatTheyAreThereToSee) {
  const auto fault = [](const Spec& spec) { return Fault(spec); };
  const Spec good{"slalom_a_total", Type::kCounter, "actor", "A thing.", {}, {}};
  EXPECT_EQ(fault(good), "");
  Spec bad = good;
  bad.name = "slalom_a";
  EXPECT_NE(fault(bad), "");
  bad = good;
  bad.type = Type::kGauge;
  EXPECT_NE(fault(bad), "");
  bad = good;
  bad.labels = {"name"};
  EXPECT_NE(fault(bad), "");
  bad = good;
  bad.roles = "actors";
  EXPECT_NE(fault(bad), "");
  bad = {"slalom_a_seconds", Type::kHistogram, "actor", "A thing.", {}, {1.0, 1.0}};
  EXPECT_NE(fault(bad), "");
}

TEST(CatalogueTest, NamesAreOfOneMetricEach) {
  std::set<std::string_view> names;
  for (const Spec* spec : All()) EXPECT_TRUE(names.insert(spec->name).second) << spec->name;
}

// A registry takes every one of them: the library has rules on names, too.
TEST(CatalogueTest, EveryMetricCanBeShown) {
  Registry registry("actor", "a1");
  for (const Spec* spec : All()) {
    if (!spec->labels.empty()) continue;
    if (spec->type == Type::kCounter) registry.counter(*spec);
    if (spec->type == Type::kGauge) registry.gauge(*spec);
    if (spec->type == Type::kHistogram) registry.histogram(*spec);
  }
  std::vector<Sample> samples;
  for (const Spec* spec : All()) {
    // Those of a sweep have no handles, since its cells come and go.
    if (spec->roles == "sweep") {
      samples.push_back({spec, std::vector<std::string>(spec->labels.size(), "x"), 1.0});
      continue;
    }
    switch (spec->labels.size()) {
      case 0:
        break;
      case 1:
        if (spec->type == Type::kCounter) registry.counter(*spec, {"x"});
        if (spec->type == Type::kGauge) registry.gauge(*spec, {"x"});
        break;
      case 2:
        if (spec->type == Type::kCounter) registry.counter(*spec, {"x", "y"});
        if (spec->type == Type::kGauge) registry.gauge(*spec, {"x", "y"});
        break;
      default:
        FAIL() << spec->name << ": teach this test";
    }
  }
  registry.Replace(samples);
  const std::string text = registry.Text();
  for (const Spec* spec : All()) {
    EXPECT_THAT(text, testing::HasSubstr("# TYPE " + std::string(spec->name) + " " +
                                         std::string(ToString(spec->type)) + "\n"));
  }
}

TEST(CatalogueTest, ThePageNamesEveryMetric) {
  const std::string page = PrintMarkdown();
  for (const Spec* spec : All()) {
    EXPECT_THAT(page, testing::HasSubstr("| `" + std::string(spec->name) + "` | "));
  }
}

}  // namespace
}  // namespace slalom::metrics
