#include "sim/courses/world_file.h"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/file.h"

namespace slalom::sim {
namespace {

using tinyxml2::XMLElement;

constexpr std::string_view kBlanks = " \t\r\n";
constexpr std::string_view kEnd = "</sdf>";

/// Reads the elements of one file; every `Fail` names the file and the line.
class WorldReader {
 public:
  explicit WorldReader(std::string_view source) : source_(source) {}

  World Run(const tinyxml2::XMLDocument& document) {
    const XMLElement* sdf = document.FirstChildElement("sdf");
    const XMLElement* world = sdf != nullptr ? sdf->FirstChildElement("world") : nullptr;
    if (world == nullptr) {
      throw base::Error(fmt::format("{}: holds no <sdf> with a <world>", source_));
    }
    for (const XMLElement* model = world->FirstChildElement("model"); model != nullptr;
         model = model->NextSiblingElement("model")) {
      ReadModel(*model);
    }
    return std::move(world_);
  }

 private:
  [[noreturn]] void Fail(const XMLElement& element, const std::string& what) const {
    throw base::Error(fmt::format("{}:{}: {}", source_, element.GetLineNum(), what));
  }

  void ReadModel(const XMLElement& model) {
    if (model.FirstChildElement("plugin") != nullptr) {
      ++world_.num_moving_models;
      return;
    }
    if (model.FirstChildElement("include") != nullptr)
      Fail(model, "a model is included from elsewhere");
    const base::Pose2 X_WM = ReadPose(model);
    for (const XMLElement* link = model.FirstChildElement("link"); link != nullptr;
         link = link->NextSiblingElement("link")) {
      const base::Pose2 X_WL = Compose(X_WM, ReadPose(*link));
      for (const XMLElement* collision = link->FirstChildElement("collision"); collision != nullptr;
           collision = collision->NextSiblingElement("collision")) {
        ReadCollision(model, *collision, Compose(X_WL, ReadPose(*collision)));
      }
    }
  }

  void ReadCollision(const XMLElement& model, const XMLElement& collision,
                     const base::Pose2& X_WC) {
    const XMLElement* geometry = collision.FirstChildElement("geometry");
    const XMLElement* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
    if (shape == nullptr) Fail(collision, "a collision has no geometry");
    const std::string_view kind = shape->Name();
    if (kind == "plane") return;
    const XMLElement* is_static = model.FirstChildElement("static");
    if (is_static == nullptr || !is_static->BoolText(false)) {
      Fail(model, "a model is neither static nor driven by a plugin");
    }
    if (kind == "cylinder") {
      const double radius = ReadNumbers<1>(*shape, "radius")[0];
      if (!(radius > 0.0)) Fail(*shape, "the radius of a cylinder is not above 0");
      world_.circles.push_back({X_WC.p, radius});
    } else if (kind == "box") {
      const auto size = ReadNumbers<3>(*shape, "size");
      if (!(size[0] > 0.0 && size[1] > 0.0)) Fail(*shape, "the size of a box is not above 0");
      world_.boxes.push_back({X_WC, {0.5 * size[0], 0.5 * size[1]}});
    } else {
      Fail(*shape, fmt::format("a shape is a <{}>, expected <cylinder> or <box>", kind));
    }
  }

  base::Pose2 ReadPose(const XMLElement& element) const {
    if (element.FirstChildElement("pose") == nullptr) return {};
    const auto pose = ReadNumbers<6>(element, "pose");
    if (std::abs(pose[3]) > 1e-6 || std::abs(pose[4]) > 1e-6) Fail(element, "a shape is tilted");
    return {{pose[0], pose[1]}, pose[5]};
  }

  static base::Pose2 Compose(const base::Pose2& X_WA, const base::Pose2& X_AB) {
    return {base::Transform(X_WA, X_AB.p), X_WA.yaw + X_AB.yaw};
  }

  template <std::size_t N>
  std::array<double, N> ReadNumbers(const XMLElement& parent, const char* name) const {
    const XMLElement* element = parent.FirstChildElement(name);
    if (element == nullptr) Fail(parent, fmt::format("<{}> has no <{}>", parent.Name(), name));
    std::string_view text = element->GetText() != nullptr ? element->GetText() : "";
    std::array<double, N> numbers{};
    for (double& number : numbers) {
      text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      if (error != std::errc() || !(std::abs(number) <= 1e5)) {
        Fail(*element, fmt::format("<{}> does not hold {} numbers", name, N));
      }
      text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    }
    if (text.find_first_not_of(kBlanks) != std::string_view::npos) {
      Fail(*element, fmt::format("<{}> does not hold {} numbers", name, N));
    }
    return numbers;
  }

  const std::string_view source_;
  World world_;
};

}  // namespace

World ParseWorld(std::string_view text, std::string_view source) {
  text = text.substr(0, text.find_last_not_of(kBlanks) + 1);
  std::string mended;
  if (text.ends_with(kEnd.substr(0, kEnd.size() - 1))) {
    mended = std::string(text) + ">";
  } else if (const std::size_t end = text.rfind(kEnd);
             end != std::string_view::npos && end + kEnd.size() < text.size()) {
    mended = std::string(text.substr(0, end + kEnd.size()));
  }
  const std::string_view xml = mended.empty() ? text : std::string_view(mended);
  tinyxml2::XMLDocument document;
  if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
    throw base::Error(fmt::format("{}:{}: not a whole XML file ({})", source,
                                  document.ErrorLineNum(), document.ErrorName()));
  }
  World world = WorldReader(source).Run(document);
  world.has_damaged_end = !mended.empty();
  return world;
}

World ReadWorld(const std::filesystem::path& path) {
  return ParseWorld(base::ReadTextFile(path), path.string());
}

}  // namespace slalom::sim
