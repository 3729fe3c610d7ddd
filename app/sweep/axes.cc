#include "app/sweep/axes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "base/config.h"
#include "base/error.h"

namespace slalom::sweep {
namespace {

/// A value as a label: a string without its quotes.
std::string Label(const base::TomlValue& value) {
  const std::string& text = value.text;
  const bool quoted = text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
                      text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

/// The elements of a TOML array.
struct Elements {
  std::vector<base::TomlValue> values;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("values", values, "");
  }
};

base::TomlAssignments AssignmentsOf(const Axis& axis, const base::TomlValue& value) {
  if (axis.keys.size() == 1) return {{axis.keys[0], value}};
  Elements elements;
  config::SetField("values", value.text, value.where, config::ListFields(elements));
  if (elements.values.size() != axis.keys.size()) {
    throw base::Error(fmt::format(
        "{}: {} has {} values, expected {}: one for each of the axis' keys {}", value.where,
        value.text, elements.values.size(), axis.keys.size(), fmt::join(axis.keys, ", ")));
  }
  base::TomlAssignments set;
  for (std::size_t i = 0; i < axis.keys.size(); ++i) {
    set.push_back({axis.keys[i], {elements.values[i].text, value.where}});
  }
  return set;
}

}  // namespace

std::vector<Point> Product(const std::vector<const Axis*>& axes) {
  std::vector<Point> points = {{}};
  for (const Axis* axis : axes) {
    std::vector<Point> more;
    const std::vector<std::string> labels = AxisLabels(*axis);
    for (const Point& point : points) {
      for (std::size_t i = 0; i < axis->values.size(); ++i) {
        Point next = point;
        const auto set = AssignmentsOf(*axis, axis->values[i]);
        next.set.insert(next.set.end(), set.begin(), set.end());
        next.labels.push_back(labels[i]);
        if (!axis->num_seeds.empty()) {
          next.max_seeds = std::min(next.max_seeds, axis->num_seeds[i]);
        }
        more.push_back(std::move(next));
      }
    }
    points = std::move(more);
  }
  return points;
}

std::string AxisName(const Axis& axis) { return axis.name.empty() ? axis.keys[0] : axis.name; }

std::vector<std::string> AxisLabels(const Axis& axis) {
  if (!axis.labels.empty()) return axis.labels;
  std::vector<std::string> labels;
  for (const base::TomlValue& value : axis.values) labels.push_back(Label(value));
  return labels;
}

const Axis* ColumnAxis(const Plan& plan) {
  const auto found = std::ranges::find(plan.axes, true, &Axis::columns);
  return found == plan.axes.end() ? nullptr : &*found;
}

}  // namespace slalom::sweep
