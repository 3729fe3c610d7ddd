#pragma once

#include <string>
#include <vector>

#include "base/config_field.h"

namespace slalom::policy {

/// What an actor or a critic is made of. The defaults are the paper's (docs/original-system.md,
/// section 3.3). Part of every saved policy.
///
/// Actor: encoder -> head -> 2 outputs, tanh. Critic: encoder, then the action beside its features
/// -> head -> 1; without encoder layers the action stands beside the input itself. docs/networks.md
/// has the encoders' formulas. What makes no network is refused by `CheckNetwork`.
struct NetworkConfig {
  std::string encoder = "mlp";
  std::vector<int> encoder_layers = {512, 512};
  std::string cnn_axis = "time";
  int attention_heads = 8;
  double dropout = 0.0;
  bool dropout_everywhere = false;
  std::vector<int> head_layers = {512, 512};
  int history = 1;
  int sectors = 0;
  std::string range_transform = "linear";
  std::string goal_transform = "linear";
  bool layer_norm = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("encoder", encoder, base::OneOf{"mlp", "cnn", "gru", "transformer"}, "",
      "How the frames are read.");
    v("encoder_layers", encoder_layers, base::Range{1, 8192}, "",
      "Widths of the encoder's layers. mlp: ReLU layers, [] for none; cnn: two convolutions over "
      "time, or convolutions over beams and a last layer; gru: one for each layer; transformer: "
      "one for each block, all equal.");
    v("cnn_axis", cnn_axis, base::OneOf{"time", "beams"}, "",
      "What a cnn's windows move along: time, as the paper's, or the beams.");
    v("attention_heads", attention_heads, base::Range{1, 256}, "",
      "Heads of a transformer, a divisor of its width.");
    v("dropout", dropout, base::Range{0.0, 0.9}, "",
      "Share of a transformer's embeddings, attention weights and residuals that training drops.");
    v("dropout_everywhere", dropout_everywhere,
      "Drop them in target networks and when acting, too, as the paper's code does.");
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
