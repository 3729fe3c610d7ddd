#pragma once

#include <cstdint>
#include <fstream>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "policy/nn/network_config.h"

/// Small networks of every kind, and what PyTorch computes with them in double precision
/// (golden/make_networks.py).

namespace slalom::nn {

inline constexpr int kFrame = 15;  // Eleven ranges and the state.

struct Case {
  const char* name;
  NetworkConfig config;
};

inline void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

inline NetworkConfig Make(EncoderFamily encoder, std::vector<int> layers, int history) {
  NetworkConfig config;
  config.encoder = encoder;
  config.encoder_layers = std::move(layers);
  config.head_layers = {6};
  config.history = history;
  config.attention_heads = 2;
  return config;
}

inline NetworkConfig OverBeams(NetworkConfig config) {
  config.cnn_axis = CnnAxis::kBeams;
  return config;
}

inline NetworkConfig Dropping(NetworkConfig config) {
  config.dropout = 0.3;
  return config;
}

/// Five heads of eight columns, of which kernels take four side by side.
inline NetworkConfig NarrowHeads() {
  NetworkConfig config = Make(EncoderFamily::kTransformer, {40, 40}, 5);
  config.attention_heads = 5;
  return config;
}

inline const std::vector<Case>& Cases() {
  using enum EncoderFamily;
  static const std::vector<Case> cases = {
      {"TimeCnn1", Make(kCnn, {5, 4}, 1)},
      {"TimeCnn2", Make(kCnn, {5, 4}, 2)},
      {"TimeCnn4", Make(kCnn, {5, 4}, 4)},
      {"BeamCnn1", OverBeams(Make(kCnn, {4, 3, 5}, 1))},
      {"BeamCnn4", OverBeams(Make(kCnn, {4, 3, 5}, 4))},
      {"Gru1", Make(kGru, {4, 4}, 1)},
      {"Gru4", Make(kGru, {4, 4}, 4)},
      {"GruOfOtherWidths", Make(kGru, {3, 5, 4}, 3)},
      {"Transformer1", Make(kTransformer, {8, 8}, 1)},
      {"Transformer4", Make(kTransformer, {8, 8}, 4)},
      {"TransformerOfThreeBlocks", Make(kTransformer, {8, 8, 8}, 3)},
      {"TransformerOfNarrowHeads", NarrowHeads()},
      {"TransformerWithDropout", Dropping(Make(kTransformer, {8, 8}, 3))},
  };
  return cases;
}

/// Evenly spread in +-scale by a hash of the index, the same in every language.
inline std::vector<double> SpreadNumbers(std::int64_t count, double scale, std::uint32_t stream) {
  std::vector<double> numbers(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    std::uint32_t h = static_cast<std::uint32_t>(i) * 2654435761u + stream * 40503u;
    h = (h ^ h >> 15) * 2246822519u;
    h = (h ^ h >> 13) * 3266489917u;
    numbers[i] = scale * (h * 0x1p-31 - 1.0);
  }
  return numbers;
}

/// What tests/policy/nn/golden/make_networks.py wrote.
struct Golden {
  std::string name;
  std::int64_t num_parameters = 0;
  std::vector<double> output, gradient;
};

inline std::vector<Golden> ReadGolden() {
  std::ifstream file(SLALOM_SOURCE_DIR "/tests/policy/nn/golden/networks.txt");
  std::vector<Golden> cases;
  std::string line, word;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "case") {
      cases.emplace_back();
      words >> cases.back().name >> cases.back().num_parameters;
      continue;
    }
    std::vector<double>& values = word == "output" ? cases.back().output : cases.back().gradient;
    for (double value = 0.0; words >> value;) values.push_back(value);
  }
  return cases;
}

}  // namespace slalom::nn
