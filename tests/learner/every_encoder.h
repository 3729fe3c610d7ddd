#pragma once

#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "policy/nn/network_config.h"

namespace slalom::learner {

/// A small network of one kind.
struct EncoderCase {
  std::string name;
  nn::NetworkConfig network;
};

inline void PrintTo(const EncoderCase& c, std::ostream* out) { *out << c.name; }

/// Every encoder, with heads of one layer; the mlp also by itself and with LayerNorm.
inline std::vector<EncoderCase> EveryEncoder() {
  const auto network = [](nn::EncoderFamily encoder, std::vector<int> layers, int history) {
    nn::NetworkConfig config;
    config.encoder = encoder;
    config.encoder_layers = std::move(layers);
    config.attention_heads = 2;
    config.head_layers = {16};
    config.history = history;
    return config;
  };
  using enum nn::EncoderFamily;
  std::vector<EncoderCase> cases = {{"mlp", network(kMlp, {16}, 4)},
                                    {"head", network(kMlp, {}, 1)},
                                    {"norm", network(kMlp, {16}, 1)},
                                    {"cnn", network(kCnn, {16, 12}, 4)},
                                    {"beams", network(kCnn, {6, 12}, 4)},
                                    {"gru", network(kGru, {12, 12}, 4)},
                                    {"transformer", network(kTransformer, {16, 16}, 4)}};
  cases[2].network.layer_norm = true;
  cases[4].network.cnn_axis = nn::CnnAxis::kBeams;
  return cases;
}

}  // namespace slalom::learner
