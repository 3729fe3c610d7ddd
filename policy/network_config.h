#pragma once

#include <string>
#include <vector>

#include "base/config_field.h"

namespace slalom::policy {

/// What an actor or a critic is made of. The defaults are the paper's (original-system.md §3.3).
/// Part of every saved policy.
///
/// Actor: encoder -> head -> 2 outputs, tanh. Critic: encoder, then the action beside its features
/// -> head -> 1; without encoder layers the action stands beside the input itself.
struct NetworkConfig {
  std::string encoder = "mlp";
  std::vector<int> encoder_layers = {512, 512};
  std::vector<int> head_layers = {512, 512};
  int history = 1;
  int sectors = 0;
  std::string range_transform = "linear";
  std::string goal_transform = "linear";
  bool layer_norm = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("encoder", encoder, base::OneOf{"mlp"}, "", "How the frames are read.");
    v("encoder_layers", encoder_layers, base::Range{1, 8192}, "",
      "Widths of the encoder's ReLU layers; [] for none.");
    v("head_layers", head_layers, base::Range{1, 8192}, "",
      "Widths of the head's ReLU layers; [] for none.");
    v("history", history, base::Range{1, 64}, "frames", "Frames seen at once, the newest last.");
    v("sectors", sectors, base::Range{0, 4096}, "",
      "Sectors whose nearest range is seen, a divisor of the number of beams; 0: every beam.");
    v("range_transform", range_transform, base::OneOf{"linear", "inverse"}, "",
      "linear: 0 -> -1, clip -> +1, as the interface. inverse: 0.6 / (r + 0.2) - 0.8, finer near "
      "by.");
    v("goal_transform", goal_transform, base::OneOf{"linear", "centred"}, "",
      "linear: g / scale - 1 for x and y, as the interface. centred: the same for x, y / scale, so "
      "that left and right mirror.");
    v("layer_norm", layer_norm, "LayerNorm before each ReLU of the critics.");
  }

  friend bool operator==(const NetworkConfig&, const NetworkConfig&) = default;
};

}  // namespace slalom::policy
