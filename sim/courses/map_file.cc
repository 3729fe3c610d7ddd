#include "sim/courses/map_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <system_error>

#include "base/error.h"
#include "base/file.h"
#include "base/split.h"

namespace slalom::sim {
namespace {

constexpr std::string_view kSpaces = " \t\r\n\v\f";
constexpr std::string_view kMapKeys =
    "image, resolution, origin, negate, occupied_thresh, free_thresh, mode";
constexpr double kMaxPixels = 5.0e7;

/// A line of YAML up to its comment.
std::string_view WithoutComment(std::string_view line) {
  char quote = '\0';
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#' && (i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t')) {
      return line.substr(0, i);
    }
  }
  return line;
}

std::string_view Unquoted(std::string_view text) {
  const bool is_quoted = text.size() >= 2 && text.front() == text.back() &&
                         (text.front() == '"' || text.front() == '\'');
  return is_quoted ? text.substr(1, text.size() - 2) : text;
}

/// The keys of a description: lines "KEY: VALUE", of which a list is "[A, B]" or lines "- A".
class DescriptionReader {
 public:
  DescriptionReader(std::string_view text, std::string_view source) : source_(source) {
    Entry* last = nullptr;
    int number = 0;
    for (const std::string_view whole : base::Split(text, '\n')) {
      ++number;
      const std::string_view line = base::Trim(WithoutComment(whole));
      if (line.empty() || line == "---") continue;
      if (line.starts_with("- ") && last != nullptr && last->text.empty()) {
        last->items.push_back(base::Trim(line.substr(2)));
      } else {
        last = &Add(line, number);
      }
    }
  }

  std::string Text(std::string_view key) const {
    const Entry& entry = Find(key);
    const std::string_view text = Unquoted(entry.text);
    if (text.empty() || !entry.items.empty()) Fail(entry, key, "expected text");
    return std::string(text);
  }

  double Number(std::string_view key, double low, double high) const {
    const Entry& entry = Find(key);
    const auto number = base::ParseNumber<double>(entry.text);
    if (!entry.items.empty() || !number || !(*number >= low && *number <= high)) {
      Fail(entry, key, fmt::format("expected a number from {} to {}", low, high));
    }
    return *number;
  }

  bool Bool(std::string_view key) const {
    const Entry& entry = Find(key);
    const bool is_true = entry.text == "1" || entry.text == "true";
    if (!is_true && entry.text != "0" && entry.text != "false") Fail(entry, key, "expected 0 or 1");
    return is_true;
  }

  base::Pose2 Pose(std::string_view key) const {
    const Entry& entry = Find(key);
    std::vector<std::string_view> items = entry.items;
    if (items.empty() && entry.text.starts_with('[') && entry.text.ends_with(']')) {
      items = base::Split(entry.text.substr(1, entry.text.size() - 2), ',');
    }
    std::vector<double> numbers;
    numbers.reserve(items.size());
    for (const std::string_view item : items) {
      numbers.push_back(base::ParseNumber<double>(base::Trim(item)).value_or(NAN));
    }
    const auto is_good = [](double number) { return std::abs(number) < 1e5; };
    if (numbers.size() != 3 || !std::ranges::all_of(numbers, is_good)) {
      Fail(entry, key, "expected [X, Y, YAW], three numbers between -1e5 and 1e5");
    }
    return {{numbers[0], numbers[1]}, numbers[2]};
  }

  bool Has(std::string_view key) const { return entries_.contains(key); }

  [[noreturn]] void Refuse(std::string_view key, std::string_view expected) const {
    Fail(Find(key), key, expected);
  }

 private:
  struct Entry {
    int line = 0;
    std::string_view text;
    std::vector<std::string_view> items;  // Of the lines "- ITEM" after it.
  };

  Entry& Add(std::string_view line, int number) {
    const std::size_t colon = line.find(':');
    base::ThrowIf(
        colon == std::string_view::npos ||
            (colon + 1 < line.size() && line[colon + 1] != ' ' && line[colon + 1] != '\t'),
        "{}:{}: found \"{}\", expected \"KEY: VALUE\"", source_, number, line);
    const std::string_view key = line.substr(0, colon);
    const auto keys = base::Split(kMapKeys, ',');
    if (std::ranges::none_of(keys,
                             [&](std::string_view known) { return base::Trim(known) == key; })) {
      throw base::Error("{}:{}: found the key \"{}\", expected one of {}", source_, number, key,
                        kMapKeys);
    }
    const auto [entry, is_new] =
        entries_.emplace(key, Entry{number, base::Trim(line.substr(colon + 1)), {}});
    base::ThrowIf(!is_new, "{}:{}: the key {} is there a second time", source_, number, key);
    return entry->second;
  }

  const Entry& Find(std::string_view key) const {
    const auto found = entries_.find(key);
    base::ThrowIf(found == entries_.end(),
                  "{}: the key {} is missing, expected a map of ROS with the keys {}", source_, key,
                  kMapKeys);
    return found->second;
  }

  [[noreturn]] void Fail(const Entry& entry, std::string_view key,
                         std::string_view expected) const {
    throw base::Error("{}:{}: {} is \"{}\", {}", source_, entry.line, key,
                      entry.items.empty() ? std::string(entry.text)
                                          : fmt::format("{}", fmt::join(entry.items, ", ")),
                      expected);
  }

  const std::string_view source_;
  std::map<std::string_view, Entry> entries_;
};

/// Reads the pixels of a PGM image one after the other, from the upper left corner.
class PgmReader {
 public:
  PgmReader(std::string_view bytes, std::string_view source) : bytes_(bytes), source_(source) {
    is_binary_ = bytes.starts_with("P5");
    base::ThrowIf(
        !is_binary_ && !bytes.starts_with("P2"),
        "{}: is no PGM image (P2 or P5), expected one, into which image programs convert others",
        source);
    position_ = 2;
    num_x_ = ReadNumber("width", 1, 1'000'000);
    num_y_ = ReadNumber("height", 1, 1'000'000);
    if (static_cast<double>(num_x_) * num_y_ > kMaxPixels) {
      Fail(fmt::format("the image has {} x {} pixels, expected at most {:.0f}", num_x_, num_y_,
                       kMaxPixels));
    }
    max_value_ = ReadNumber("largest value", 1, 65535);
    const std::size_t num_pixels =
        static_cast<std::size_t>(num_x_) * static_cast<std::size_t>(num_y_);
    if (is_binary_ && position_ < bytes_.size()) ++position_;  // One blank.
    const std::size_t needed = num_pixels * (!is_binary_ || max_value_ > 255 ? 2 : 1);
    const std::size_t there = bytes_.size() - position_;
    base::ThrowIf(there < needed, "{}: is cut short: {} bytes of pixels, expected {} for {} x {}",
                  source_, there, needed, num_x_, num_y_);
  }

  int num_x() const { return num_x_; }
  int num_y() const { return num_y_; }
  int max_value() const { return max_value_; }

  int Next() {
    if (!is_binary_) return ReadNumber("pixel", 0, max_value_);
    int value = static_cast<unsigned char>(bytes_[position_++]);
    if (max_value_ > 255) value = 256 * value + static_cast<unsigned char>(bytes_[position_++]);
    base::ThrowIf(value > max_value_, "{}: a pixel is {}, expected at most {}", source_, value,
                  max_value_);
    return value;
  }

  void End() const {
    const std::string_view rest = bytes_.substr(position_);
    base::ThrowIf(rest.find_first_not_of(kSpaces) != std::string_view::npos,
                  "{}: has {} bytes after its {} x {} pixels, expected none", source_, rest.size(),
                  num_x_, num_y_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    const auto line = 1 + std::ranges::count(bytes_.substr(0, position_), '\n');
    throw base::Error("{}:{}: {}", source_, line, what);
  }

  /// The next number after blanks and comments.
  int ReadNumber(std::string_view meaning, int low, int high) {
    const std::size_t before = position_;
    while (position_ < bytes_.size()) {
      if (bytes_[position_] == '#') {
        position_ = std::min(bytes_.find('\n', position_), bytes_.size());
      } else if (kSpaces.find(bytes_[position_]) == std::string_view::npos) {
        break;
      } else {
        ++position_;
      }
    }
    int number = 0;
    const char* begin = bytes_.data() + position_;
    const auto [end, error] = std::from_chars(begin, bytes_.data() + bytes_.size(), number);
    if (position_ == before || error != std::errc() || number < low || number > high) {
      Fail(fmt::format("the {} is no whole number from {} to {}", meaning, low, high));
    }
    position_ += static_cast<std::size_t>(end - begin);
    return number;
  }

  const std::string_view bytes_;
  const std::string_view source_;
  bool is_binary_ = false;
  int num_x_ = 0;
  int num_y_ = 0;
  int max_value_ = 0;
  std::size_t position_ = 0;
};

}  // namespace

MapDescription ParseMapDescription(std::string_view text, std::string_view source) {
  const DescriptionReader reader(text, source);
  MapDescription description;
  description.image = reader.Text("image");
  description.resolution = reader.Number("resolution", 1e-3, 1e3);
  description.X_WM = reader.Pose("origin");
  description.negate = reader.Bool("negate");
  description.occupied_threshold = reader.Number("occupied_thresh", 0.0, 1.0);
  description.free_threshold = reader.Number("free_thresh", 0.0, 1.0);
  if (description.free_threshold > description.occupied_threshold) {
    reader.Refuse("free_thresh", "expected at most occupied_thresh");
  }
  if (reader.Has("mode")) {
    // trinary and scale differ in what lies between the thresholds, of which nothing is certain.
    const std::string mode = reader.Text("mode");
    description.is_raw = mode == "raw";
    if (mode != "raw" && mode != "trinary" && mode != "scale") {
      reader.Refuse("mode", "expected trinary, scale or raw");
    }
  }
  if (description.is_raw && description.negate) {
    reader.Refuse("negate", "expected 0 in mode raw, where ROS 1 and ROS 2 disagree on it");
  }
  return description;
}

OccupancyMap ParseMapImage(const MapDescription& description, std::string_view bytes,
                           std::string_view source) {
  PgmReader reader(bytes, source);
  const bool is_raw = description.is_raw;
  base::ThrowIf(is_raw && reader.max_value() != 255,
                "{}: its largest value is {}, expected 255 in mode raw", source,
                reader.max_value());
  OccupancyMap map{reader.num_x(), reader.num_y(), description.resolution, description.X_WM, {}};
  const auto num_x = static_cast<std::size_t>(map.num_x);
  map.cells.resize(num_x * static_cast<std::size_t>(map.num_y));
  for (std::size_t y = static_cast<std::size_t>(map.num_y); y-- > 0;) {
    for (std::size_t x = 0; x < num_x; ++x) {
      const int pixel = reader.Next();
      const int dark = description.negate ? pixel : reader.max_value() - pixel;
      const double occupancy =
          is_raw ? pixel / 100.0 : static_cast<double>(dark) / reader.max_value();
      const bool is_known = !is_raw || pixel <= 100;
      map.cells[y * num_x + x] =
          is_known && occupancy > description.occupied_threshold ? Occupancy::kOccupied
          : is_known && occupancy < description.free_threshold   ? Occupancy::kFree
                                                                 : Occupancy::kUnknown;
    }
  }
  reader.End();
  return map;
}

OccupancyMap ReadMap(const std::filesystem::path& path) {
  const MapDescription description = ParseMapDescription(base::ReadTextFile(path), path.string());
  const std::filesystem::path image = path.parent_path() / description.image;
  return ParseMapImage(description, base::ReadFile(image), image.string());
}

}  // namespace slalom::sim
