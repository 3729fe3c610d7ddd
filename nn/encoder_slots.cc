#include "nn/encoder_slots.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/check.h"
#include "base/error.h"
#include "env/observation.h"

namespace slalom::nn {
namespace {

constexpr double kGpt2Deviation = 0.02;  // Of the weights in a block, as the original's library.
constexpr int kTimeTaps = 3;

[[noreturn]] void RefuseLayers(const NetworkConfig& config, std::string_view expected) {
  throw base::Error(
      fmt::format("network.encoder_layers: found [{}] with encoder \"{}\", expected {}",
                  fmt::join(config.encoder_layers, ", "), config.encoder, expected));
}

/// Convolutions over time: [O, taps, I], the frames of a window side by side.
std::vector<ParameterSlot> TimeConvolutionSlots(const NetworkConfig& config, int frame_size) {
  ParameterSlots slots;
  const auto add = [&slots](const std::string& name, int outputs, int taps, int inputs) {
    const InitialValues initial = InitialValues::Uniform(taps * inputs);
    slots.Add(name + ".weight", {outputs, taps, inputs}, initial);
    slots.Add(name + ".bias", {outputs}, initial);
  };
  add("encoder.0", config.encoder_layers[0], kTimeTaps, frame_size);
  add("encoder.1", config.encoder_layers[1], config.history, config.encoder_layers[0]);
  return slots.Take();
}

std::vector<ParameterSlot> BeamConvolutionSlots(const NetworkConfig& config, int frame_size) {
  ParameterSlots slots;
  const std::vector<BeamConvolution> layers = BeamConvolutions(config, frame_size);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const BeamConvolution& layer = layers[i];
    const InitialValues initial = InitialValues::Uniform(layer.width * layer.in_channels);
    slots.Add(fmt::format("encoder.{}.weight", i),
              {layer.out_channels, layer.width, layer.in_channels}, initial);
    slots.Add(fmt::format("encoder.{}.bias", i), {layer.out_channels}, initial);
  }
  const BeamConvolution& last = layers.back();
  slots.AddLinear(fmt::format("encoder.{}", layers.size()), config.encoder_layers.back(),
                  static_cast<std::int64_t>(last.out_positions) * last.out_channels +
                      config.history * env::kStateSize);
  return slots.Take();
}

std::vector<ParameterSlot> GruSlots(const NetworkConfig& config, int frame_size) {
  ParameterSlots slots;
  std::int64_t inputs = frame_size;
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    const std::int64_t width = config.encoder_layers[i];
    const InitialValues initial = InitialValues::Uniform(width);
    const std::string layer = fmt::format("encoder.{}.", i);
    slots.Add(layer + "input.weight", {3 * width, inputs}, initial);
    slots.Add(layer + "input.bias", {3 * width}, initial);
    slots.Add(layer + "state.weight", {3 * width, width}, initial);
    slots.Add(layer + "state.bias", {3 * width}, initial);
    inputs = width;
  }
  return slots.Take();
}

std::vector<ParameterSlot> TransformerSlots(const NetworkConfig& config, int frame_size) {
  ParameterSlots slots;
  const std::int64_t width = config.encoder_layers.front();
  const auto add = [&slots](const std::string& name, std::int64_t outputs, std::int64_t inputs) {
    slots.Add(name + ".weight", {outputs, inputs}, InitialValues::Normal(kGpt2Deviation));
    slots.Add(name + ".bias", {outputs}, InitialValues::Constant(0.0));
  };
  slots.AddLinear("encoder.embedding", width, frame_size);
  slots.Add("encoder.time", {config.history, width}, InitialValues::Normal(1.0));
  slots.AddNorm("encoder.embedding.norm", width);
  for (std::size_t i = 0; i < config.encoder_layers.size(); ++i) {
    const std::string block = fmt::format("encoder.{}.", i);
    slots.AddNorm(block + "attention.norm", width);
    add(block + "attention.query_key_value", 3 * width, width);
    add(block + "attention.output", width, width);
    slots.AddNorm(block + "mlp.norm", width);
    add(block + "mlp.0", 4 * width, width);
    add(block + "mlp.1", width, 4 * width);
  }
  slots.AddNorm("encoder.norm", width);
  return slots.Take();
}

}  // namespace

void CheckNetwork(const NetworkConfig& config) {
  const std::vector<int>& layers = config.encoder_layers;
  const bool over_beams = config.cnn_axis == "beams";
  if (over_beams && config.encoder != "cnn") {
    throw base::Error(fmt::format(
        "network.cnn_axis: found \"beams\" with encoder \"{}\", expected encoder \"cnn\"",
        config.encoder));
  }
  if (config.encoder != "transformer" && (config.dropout > 0.0 || config.dropout_everywhere)) {
    throw base::Error(fmt::format(
        "network.dropout: found {}, everywhere = {}, with encoder \"{}\", expected encoder "
        "\"transformer\", which alone has dropout",
        config.dropout, config.dropout_everywhere, config.encoder));
  }
  if (config.encoder == "cnn" && !over_beams && layers.size() != 2) {
    RefuseLayers(config, "two widths, of the convolutions over time");
  }
  if (over_beams && layers.size() < 2) {
    RefuseLayers(config, "the channels of one convolution or more and a width");
  }
  if (config.encoder == "gru" && layers.empty()) RefuseLayers(config, "one width or more");
  if (config.encoder != "transformer") return;
  if (layers.empty() || std::ranges::count(layers, layers.front()) != std::ssize(layers)) {
    RefuseLayers(config, "one width or more, all equal, one for each block");
  }
  if (layers.front() % config.attention_heads != 0) {
    throw base::Error(
        fmt::format("network.attention_heads: found {}, expected a divisor of the width {}",
                    config.attention_heads, layers.front()));
  }
}

std::vector<ParameterSlot> EncoderSlots(const NetworkConfig& config, int frame_size) {
  SLALOM_CHECK(config.encoder != "mlp");
  if (config.encoder == "gru") return GruSlots(config, frame_size);
  if (config.encoder == "transformer") return TransformerSlots(config, frame_size);
  return config.cnn_axis == "beams" ? BeamConvolutionSlots(config, frame_size)
                                    : TimeConvolutionSlots(config, frame_size);
}

std::vector<BeamConvolution> BeamConvolutions(const NetworkConfig& config, int frame_size) {
  std::vector<BeamConvolution> layers;
  int positions = frame_size - env::kStateSize;
  int channels = config.history;
  for (std::size_t i = 0; i + 1 < config.encoder_layers.size(); ++i) {
    BeamConvolution layer{.width = i == 0 ? 5 : 3,
                          .stride = 2,
                          .in_channels = channels,
                          .out_channels = config.encoder_layers[i],
                          .in_positions = positions,
                          .out_positions = 0};
    if (positions < layer.width) {
      throw base::Error(
          fmt::format("network.encoder_layers: found [{}] over {} ranges, of which convolution {} "
                      "gets {}, expected {} or more; fewer convolutions or more sectors",
                      fmt::join(config.encoder_layers, ", "), frame_size - env::kStateSize, i + 1,
                      positions, layer.width));
    }
    layer.out_positions = (positions - layer.width) / layer.stride + 1;
    positions = layer.out_positions;
    channels = layer.out_channels;
    layers.push_back(layer);
  }
  return layers;
}

}  // namespace slalom::nn
