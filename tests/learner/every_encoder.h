#pragma once

#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "nn/network_config.h"

namespace slalom::learner {

/// A small network of one kind.
struct EncoderCase {
  std::string name;
  nn::NetworkConfig network;
};

inline void PrintTo(const EncoderCase& c, std::ostream* out) { *out << c.name; }

/// Every encoder, with heads of one layer; the mlp also by itself and with LayerNorm.
inline std::vector<EncoderCase> EveryEncoder() {
  const auto network = [](std::string encoder, std::vector<int> layers, int history) {
    nn::NetworkConfig config;
    config.encoder = std::move(encoder);
    config.encoder_layers = std::move(layers);
    config.attention_heads = 2;
    config.head_layers = {16};
    config.history = history;
    return config;
  };
  std::vector<EncoderCase> cases = {{"mlp", network("mlp", {16}, 4)},
                                    {"head", network("mlp", {}, 1)},
                                    {"norm", network("mlp", {16}, 1)},
                                    {"cnn", network("cnn", {16, 12}, 4)},
                                    {"beams", network("cnn", {6, 12}, 4)},
                                    {"gru", network("gru", {12, 12}, 4)},
                                    {"transformer", network("transformer", {16, 16}, 4)}};
  cases[2].network.layer_norm = true;
  cases[4].network.cnn_axis = "beams";
  return cases;
}

}  // namespace slalom::learner
