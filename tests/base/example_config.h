#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_field.h"

/// A config with a field of each type.

namespace slalom::config {

enum class Gear { kFirst, kSecond, kReverse };
inline base::OneOf EnumNames(Gear) { return {"first", "second", "reverse"}; }

struct Inner {
  double speed = 1.5;
  std::string kind = "fast";
  Gear gear = Gear::kSecond;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("speed", speed, base::Range{-10.0, 1e300}, "m/s", "How fast.");
    v("kind", kind, base::OneOf{"fast", "slow"}, "", "What kind.");
    v("gear", gear, "Which gear.");
  }
};

struct Outer {
  bool flag = false;
  int count = 3;
  std::int64_t large = 5;
  std::string name = "x";
  std::vector<int> sizes = {1, 2};
  std::vector<double> weights;
  Inner inner;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("flag", flag, "On or off.");
    v("count", count, base::Range{-100, 100}, "", "How many.");
    v("large", large, base::Range{-9e18, 9e18}, "", "A large number.");
    v("name", name, "Any text.");
    v("sizes", sizes, base::Range{-100, 100}, "", "Sizes.");
    v("weights", weights, base::Range{-1e300, 1e300}, "kg", "Weights.");
    v.Section("inner", inner, "The inner one.");
  }
};

}  // namespace slalom::config
