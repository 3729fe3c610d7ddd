#include "sim/courses/world_file.h"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/split.h"

namespace slalom::sim {
namespace {

using tinyxml2::XMLElement;

constexpr std::string_view kBlanks = " \t\r\n";
constexpr std::string_view kEnd = "</sdf>";
constexpr double kMaxTilt = 1e-6;  // [rad]

// Heights above the ground, [m]. A course is flat, so a shape is either an obstacle for the robot
// and its LiDAR, or for neither.
constexpr double kDrivenOver = 0.02;
constexpr double kLidarHeight = 0.2;
constexpr double kDrivenUnder = 0.5;

/// What an element of SDF may hold. Lists are words with blanks between them.
struct ElementRule {
  std::string_view path;         ///< Its name, within <state> after "state/".
  std::string_view understood;   ///< Elements in it that are read.
  std::string_view passed_over;  ///< Elements in it that have no effect on obstacles.
  std::string_view attributes;
};
constexpr ElementRule kRules[] = {
    {"sdf", "world", "", "version"},
    {"world", "include model plugin state",
     "atmosphere audio frame gravity gui joint light magnetic_field physics road scene "
     "spherical_coordinates wind",
     "name"},
    {"include", "pose uri", "name static", ""},
    {"model", "link plugin pose static",
     "allow_auto_disable enable_wind frame gripper joint self_collide",
     "canonical_link name placement_frame"},
    {"link", "collision pose",
     "audio_sink audio_source battery enable_wind frame gravity inertial kinematic light "
     "must_be_base_link particle_emitter projector self_collide sensor velocity_decay visual",
     "name"},
    {"collision", "geometry pose surface", "auto_inertia_params density laser_retro max_contacts",
     "name"},
    {"surface", "contact", "bounce friction soft_contact", ""},
    {"contact", "collide_bitmask collide_without_contact",
     "bullet collide_without_contact_bitmask elastic_modulus ode poissons_ratio", ""},
    {"geometry", "box cylinder plane", "empty", ""},
    {"box", "size", "", ""},
    {"cylinder", "length radius", "", ""},
    {"plane", "normal", "size", ""},
    {"pose", "", "", "degrees frame relative_to rotation_format"},
    {"state", "model", "iterations light real_time sim_time wall_time", "world_name"},
    {"state/model", "link pose scale", "", "name"},
    {"state/link", "pose", "acceleration velocity wrench", "name"},
};

bool HasWord(std::string_view list, std::string_view word) {
  for (std::size_t at = list.find(word); at != std::string_view::npos;
       at = list.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if ((at == 0 || list[at - 1] == ' ') && (end == list.size() || list[end] == ' ')) return true;
  }
  return false;
}

std::string_view TextOf(const XMLElement& element) {
  return base::Trim(element.GetText() != nullptr ? element.GetText() : "");
}

/// The value of an attribute, empty if it is not there.
std::string_view AttributeOf(const XMLElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value != nullptr ? value : "";
}

/// A pose in space, of which a course knows the plane. `is_tilted`: the rest means nothing.
struct Pose {
  base::Pose2 X;
  double z = 0.0;  // [m]
  bool is_tilted = false;
};

Pose Compose(const Pose& X_WA, const Pose& X_AB) {
  return {{base::Transform(X_WA.X, X_AB.X.p), base::WrapAngle(X_WA.X.yaw + X_AB.X.yaw)},
          X_WA.z + X_AB.z,
          X_WA.is_tilted || X_AB.is_tilted};
}

/// Reads the elements of one file; every `Fail` names the file and the line.
class WorldReader {
 public:
  explicit WorldReader(std::string_view source) : source_(source) {}

  World Run(const tinyxml2::XMLDocument& document) {
    const XMLElement* sdf = document.FirstChildElement("sdf");
    const XMLElement* world = sdf != nullptr ? Only(*sdf, "world") : nullptr;
    if (world == nullptr) throw base::Error("{}: holds no <sdf> with a <world>", source_);
    if (const XMLElement* next = sdf->NextSiblingElement()) Fail(*next, "a second <sdf> begins");
    Check(*sdf, "sdf");
    const std::string_view version = AttributeOf(*sdf, "version");
    if (!version.empty() && !version.starts_with("1.")) {
      Fail(*sdf, fmt::format("the version of SDF is \"{}\", expected 1.x", version));
    }
    Check(*world, "world");
    if (const XMLElement* state = Only(*world, "state")) ReadState(*state);
    ForEach(*world, "include", [&](const XMLElement& include) { ReadInclude(include); });
    ForEach(*world, "plugin", [&](const XMLElement& plugin) { ReadPlugin(plugin); });
    ForEach(*world, "model", [&](const XMLElement& model) { ReadModel(model); });
    for (const auto& [name, state] : states_) {
      if (!names_.contains(name)) Fail(*state, "<state> has a model that the world lacks");
    }
    return std::move(world_);
  }

 private:
  [[noreturn]] void Fail(const XMLElement& element, const std::string& what) const {
    throw base::Error("{}:{}: {}", source_, element.GetLineNum(), what);
  }

  /// Refuses what `element` holds besides what the rule of `path` names.
  void Check(const XMLElement& element, std::string_view path) const {
    const ElementRule& rule = *std::ranges::find(kRules, path, &ElementRule::path);
    for (const XMLElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (HasWord(rule.understood, child->Name()) || HasWord(rule.passed_over, child->Name())) {
        continue;
      }
      Fail(*child, fmt::format("<{}> holds <{}>, which the import does not understand, expected "
                               "one of: {} (docs/courses.md lists what is passed over)",
                               element.Name(), child->Name(),
                               rule.understood.empty() ? "nothing" : rule.understood));
    }
    for (const tinyxml2::XMLAttribute* attribute = element.FirstAttribute(); attribute != nullptr;
         attribute = attribute->Next()) {
      if (HasWord(rule.attributes, attribute->Name())) continue;
      Fail(element, fmt::format("<{}> has the attribute {}=\"{}\", which the import does not "
                                "understand, expected one of: {}",
                                element.Name(), attribute->Name(), attribute->Value(),
                                rule.attributes.empty() ? "none" : rule.attributes));
    }
  }

  template <class Call>
  static void ForEach(const XMLElement& parent, const char* name, const Call& call) {
    for (const XMLElement* child = parent.FirstChildElement(name); child != nullptr;
         child = child->NextSiblingElement(name)) {
      call(*child);
    }
  }

  /// The child of this name, null if there is none. Refuses a second one.
  const XMLElement* Only(const XMLElement& parent, const char* name) const {
    const XMLElement* child = parent.FirstChildElement(name);
    if (child == nullptr) return nullptr;
    if (const XMLElement* next = child->NextSiblingElement(name)) {
      Fail(*next, fmt::format("<{}> has a second <{}>", parent.Name(), name));
    }
    return child;
  }

  /// Refuses a value of an attribute that is none of those `allowed`.
  void RequireAttribute(const XMLElement& element, const char* name,
                        std::initializer_list<std::string_view> allowed) const {
    const std::string_view value = AttributeOf(element, name);
    if (value.empty() || std::ranges::find(allowed, value) != allowed.end()) return;
    Fail(element, fmt::format("<{}> has {}=\"{}\", which the import does not understand",
                              element.Name(), name, value));
  }

  bool ReadBool(const XMLElement& element, std::string_view text) const {
    if (text == "1" || text == "true") return true;
    if (text == "0" || text == "false") return false;
    Fail(element, fmt::format("<{}> has \"{}\", expected true or false", element.Name(), text));
  }

  void ReadState(const XMLElement& state) {
    Check(state, "state");
    ForEach(state, "model", [&](const XMLElement& model) {
      Check(model, "state/model");
      if (!states_.emplace(AttributeOf(model, "name"), &model).second) {
        Fail(model, "<state> has this model a second time");
      }
      if (Only(model, "scale") != nullptr &&
          ReadNumbers<3>(model, "scale") != std::array{1.0, 1.0, 1.0}) {
        Fail(model, "<state> scales a model, expected a <scale> of 1 1 1");
      }
    });
  }

  /// A name of a model, by which a <state> may know it.
  void AddName(const XMLElement& model, std::string_view name) {
    if (!names_.emplace(name).second && states_.contains(name)) {
      Fail(model, fmt::format("a second model is called \"{}\", which <state> names", name));
    }
  }

  void ReadInclude(const XMLElement& include) {
    const XMLElement* uri = Only(include, "uri");
    const std::string_view text = uri != nullptr ? TextOf(*uri) : "";
    if (text != "model://sun" && text != "model://ground_plane") {
      Fail(include, fmt::format("the model \"{}\" is included from elsewhere, expected models in "
                                "the file itself, besides sun and ground_plane",
                                text));
    }
    Check(include, "include");
    if (text == "model://ground_plane") CheckGround(include, ReadPose(include, "world"));
    const XMLElement* name = Only(include, "name");
    AddName(include, name != nullptr ? TextOf(*name) : text.substr(text.rfind('/') + 1));
  }

  void CheckGround(const XMLElement& element, const Pose& X_WG) const {
    if (X_WG.is_tilted) Fail(element, "the ground is tilted");
    if (std::abs(X_WG.z) > kDrivenOver) {
      Fail(element, fmt::format("the ground is at height {}, expected 0", X_WG.z));
    }
  }

  /// Plugins of ROS and Gazebo themselves serve and record what there is.
  void ReadPlugin(const XMLElement& plugin) const {
    std::string_view file = AttributeOf(plugin, "filename");
    if (file.starts_with("lib")) file.remove_prefix(3);
    for (const std::string_view known : {"gazebo_ros_", "gz-sim-", "ignition-gazebo-"}) {
      if (file.starts_with(known)) return;
    }
    Fail(plugin, fmt::format("a plugin of the world, \"{}\", may add or move models, expected "
                             "none but those of Gazebo and gazebo_ros",
                             AttributeOf(plugin, "filename")));
  }

  void ReadModel(const XMLElement& model) {
    Check(model, "model");
    RequireAttribute(model, "placement_frame", {});
    const std::string_view name = AttributeOf(model, "name");
    AddName(model, name);
    if (model.FirstChildElement("plugin") != nullptr) {
      world_.moving_model_lines.push_back(model.GetLineNum());
      return;
    }
    const auto found = states_.find(name);
    const XMLElement* state = found != states_.end() ? found->second : nullptr;
    const Pose X_WM = ReadPose(state != nullptr ? *state : model, "world");
    std::map<std::string_view, const XMLElement*> link_states;
    if (state != nullptr) {
      ForEach(*state, "link", [&](const XMLElement& link) {
        Check(link, "state/link");
        if (!link_states.emplace(AttributeOf(link, "name"), &link).second) {
          Fail(link, "<state> has this link a second time");
        }
      });
    }
    ForEach(model, "link", [&](const XMLElement& link) {
      Check(link, "link");
      const auto link_state = link_states.extract(AttributeOf(link, "name"));
      const Pose X_ML = ReadPose(link, "__model__");
      ReadLink(model, link,
               link_state.empty() ? Compose(X_WM, X_ML) : ReadPose(*link_state.mapped(), ""));
    });
    if (!link_states.empty()) {
      Fail(*link_states.begin()->second, "<state> has a link that the model lacks");
    }
  }

  void ReadLink(const XMLElement& model, const XMLElement& link, const Pose& X_WL) {
    ForEach(link, "collision", [&](const XMLElement& collision) {
      Check(collision, "collision");
      CheckSurface(collision);
      const XMLElement* geometry = Only(collision, "geometry");
      const XMLElement* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
      if (shape == nullptr) Fail(collision, "a collision has no geometry");
      Check(*geometry, "geometry");
      if (const XMLElement* next = shape->NextSiblingElement()) {
        Fail(*next, "a collision has a second shape");
      }
      const std::string_view kind = shape->Name();
      if (kind == "empty") return;
      Check(*shape, kind);
      const Pose X_WC = Compose(X_WL, ReadPose(collision, ""));
      if (kind == "plane") {
        ReadPlane(*shape, X_WC);
        return;
      }
      RequireStatic(model);
      if (X_WC.is_tilted) Fail(collision, "a shape is tilted, expected roll and pitch 0");
      if (kind == "box") {
        ReadBox(*shape, X_WC);
      } else {
        ReadCylinder(*shape, X_WC);
      }
    });
  }

  /// What collides must stop the robot.
  void CheckSurface(const XMLElement& collision) const {
    const XMLElement* surface = Only(collision, "surface");
    if (surface == nullptr) return;
    Check(*surface, "surface");
    const XMLElement* contact = Only(*surface, "contact");
    if (contact == nullptr) return;
    Check(*contact, "contact");
    const XMLElement* without = Only(*contact, "collide_without_contact");
    if (without != nullptr && ReadBool(*without, TextOf(*without))) {
      Fail(*without, "a shape collides without contact, expected 0");
    }
    const XMLElement* mask = Only(*contact, "collide_bitmask");
    if (mask != nullptr && TextOf(*mask).find_first_not_of("0x") == std::string_view::npos) {
      Fail(*mask, "a shape collides with nothing, expected a bit of the mask to be set");
    }
  }

  void RequireStatic(const XMLElement& model) const {
    bool is_static = false;
    ForEach(model, "static", [&](const XMLElement& element) {
      if (!ReadBool(element, TextOf(element))) {
        Fail(element, "a model is neither static nor driven by a plugin");
      }
      is_static = true;
    });
    if (!is_static) Fail(model, "a model is neither static nor driven by a plugin");
  }

  void ReadPlane(const XMLElement& plane, const Pose& X_WC) const {
    if (Only(plane, "normal") != nullptr) {
      const auto normal = ReadNumbers<3>(plane, "normal");
      if (normal[0] != 0.0 || normal[1] != 0.0 || !(normal[2] > 0.0)) {
        Fail(plane, "a plane is not level, expected <normal> 0 0 1: the ground");
      }
    }
    CheckGround(plane, X_WC);
  }

  void ReadCylinder(const XMLElement& cylinder, const Pose& X_WC) {
    const double radius = ReadNumbers<1>(cylinder, "radius")[0];
    if (!(radius > 0.0)) Fail(cylinder, "the radius of a cylinder is not above 0");
    const double length = ReadNumbers<1>(cylinder, "length")[0];
    if (!(length > 0.0)) Fail(cylinder, "the length of a cylinder is not above 0");
    if (IsInReach(cylinder, X_WC.z, length)) world_.circles.push_back({X_WC.X.p, radius});
  }

  void ReadBox(const XMLElement& box, const Pose& X_WC) {
    const auto size = ReadNumbers<3>(box, "size");
    if (!(size[0] > 0.0 && size[1] > 0.0 && size[2] > 0.0)) {
      Fail(box, "the size of a box is not above 0");
    }
    if (IsInReach(box, X_WC.z, size[2])) {
      world_.boxes.push_back({X_WC.X, {0.5 * size[0], 0.5 * size[1]}});
    }
  }

  /// Whether a shape is at the height of the robot and of its LiDAR. Refuses one that is at the
  /// height of the robot only.
  bool IsInReach(const XMLElement& shape, double z, double height) {
    const double bottom = z - 0.5 * height;
    const double top = z + 0.5 * height;
    if (top <= kDrivenOver || bottom >= kDrivenUnder) {
      ++world_.num_out_of_reach;
      return false;
    }
    if (bottom <= kLidarHeight && top >= kLidarHeight) return true;
    Fail(shape, fmt::format("a shape reaches from {:g} to {:g} m above the ground, so that the "
                            "robot hits it and a LiDAR {} m above the ground does not see it",
                            bottom, top, kLidarHeight));
  }

  /// The <pose> of `element` in the frame that SDF means without `relative_to`, whose name is
  /// `frame`; empty: it has none.
  Pose ReadPose(const XMLElement& element, std::string_view frame) const {
    const XMLElement* pose = Only(element, "pose");
    if (pose == nullptr) return {};
    Check(*pose, "pose");
    RequireAttribute(*pose, "frame", {});
    RequireAttribute(*pose, "relative_to", {frame});
    RequireAttribute(*pose, "rotation_format", {"euler_rpy"});
    const std::string_view degrees = AttributeOf(*pose, "degrees");
    const double unit =
        !degrees.empty() && ReadBool(*pose, degrees) ? base::kPi / 180.0 : 1.0;  // [rad]
    const auto numbers = ReadNumbers<6>(element, "pose");
    return {{{numbers[0], numbers[1]}, base::WrapAngle(unit * numbers[5])},
            numbers[2],
            std::abs(unit * numbers[3]) > kMaxTilt || std::abs(unit * numbers[4]) > kMaxTilt};
  }

  template <std::size_t N>
  std::array<double, N> ReadNumbers(const XMLElement& parent, const char* name) const {
    const XMLElement* element = Only(parent, name);
    if (element == nullptr) Fail(parent, fmt::format("<{}> has no <{}>", parent.Name(), name));
    std::string_view text = TextOf(*element);
    const auto fail = [&] {
      Fail(*element, fmt::format("<{}> holds \"{}\", expected {} number{} between -1e5 and 1e5",
                                 name, TextOf(*element), N, N == 1 ? "" : "s"));
    };
    std::array<double, N> numbers{};
    for (double& number : numbers) {
      text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      if (error != std::errc() || !(std::abs(number) <= 1e5)) fail();
      text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    }
    if (!text.empty()) fail();
    return numbers;
  }

  const std::string_view source_;
  std::map<std::string, const XMLElement*, std::less<>> states_;  // Models in <state> by name.
  std::set<std::string, std::less<>> names_;                      // Models of the world.
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
    throw base::Error("{}:{}: not a whole XML file ({})", source, document.ErrorLineNum(),
                      document.ErrorName());
  }
  World world = WorldReader(source).Run(document);
  world.has_damaged_end = !mended.empty();
  return world;
}

World ReadWorld(const std::filesystem::path& path) {
  return ParseWorld(base::ReadTextFile(path), path.string());
}

}  // namespace slalom::sim
