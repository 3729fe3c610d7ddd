#include "policy/onnx/onnx_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/version.h"
#include "env/observation.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/inference/layers.h"
#include "policy/onnx/onnx.pb.h"
#include "policy/policy_spec.h"

/// Shapes: `B` batch, `N` beams, `R` ranges and `F` features of a frame, `H` frames of history, `W`
/// width of a layer.

namespace slalom::policy {
namespace {

/// The types of numbers, by their codes in ONNX's TensorProto.DataType.
enum class NumberType { kFloat = 1, kUint16 = 4, kBool = 9 };

/// The name of a value that flows through a graph: an input, a constant or the output of a node.
using Value = std::string;

/// An attribute of a node.
struct Attribute {
  const char* name;
  std::variant<std::int64_t, float, std::vector<std::int64_t>> value;
};

/// An input or output of the graph. Its first dimension is the batch.
struct Port {
  const char* name;
  NumberType type = NumberType::kFloat;
  std::vector<std::int64_t> shape;  ///< Without the batch.
  std::string meaning;              ///< Meaning of the numbers for people, with units.
};

namespace wire = onnx;

constexpr std::int64_t kIrVersion = 8;
constexpr std::int64_t kOperatorSet = 17;  // The first with LayerNormalization.
constexpr int kInt64 = 7;                  // Value of TensorProto.DataType.

static_assert(std::endian::native == std::endian::little, "raw_data is little-endian");

template <class T>
void FillTensor(const std::string& name, int type, const std::vector<std::int64_t>& shape,
                std::span<const T> numbers, wire::TensorProto* tensor) {
  tensor->set_name(name);
  tensor->set_data_type(type);
  for (const std::int64_t size : shape) tensor->add_dims(size);
  tensor->set_raw_data(numbers.data(), numbers.size_bytes());
}

void FillPort(const Port& port, wire::ValueInfoProto* info) {
  info->set_name(port.name);
  info->set_doc_string(port.meaning);
  wire::TypeProto::Tensor* const tensor = info->mutable_type()->mutable_tensor_type();
  tensor->set_elem_type(static_cast<int>(port.type));
  tensor->mutable_shape()->add_dim()->set_dim_param("batch");
  for (const std::int64_t size : port.shape) {
    tensor->mutable_shape()->add_dim()->set_dim_value(size);
  }
}

void FillAttribute(const Attribute& attribute, wire::AttributeProto* filled) {
  filled->set_name(attribute.name);
  if (const auto* integer = std::get_if<std::int64_t>(&attribute.value)) {
    filled->set_type(wire::AttributeProto::INT);
    filled->set_i(*integer);
  } else if (const auto* number = std::get_if<float>(&attribute.value)) {
    filled->set_type(wire::AttributeProto::FLOAT);
    filled->set_f(*number);
  } else {
    filled->set_type(wire::AttributeProto::INTS);
    for (const std::int64_t i : std::get<2>(attribute.value)) filled->add_ints(i);
  }
}

/// Builds an ONNX model of operator set 17, node by node. Confined to one thread.
class GraphBuilder {
 public:
  Value AddInput(const Port& port) {
    FillPort(port, graph_.add_input());
    return Unique(port.name);
  }

  /// Makes `value` an output of the graph, under the port's name.
  void AddOutput(const Port& port, const Value& value) {
    FillPort(port, graph_.add_output());
    wire::NodeProto* const node = graph_.add_node();
    node->set_op_type("Identity");
    node->set_name(Unique("Identity"));
    node->add_input(value);
    node->add_output(port.name);
  }

  /// Constants. The product of `shape` is the number of `numbers`.
  Value Number(float number) { return Tensor("number", {}, {&number, 1}); }

  Value Tensor(std::string_view name, const std::vector<std::int64_t>& shape,
               std::span<const float> numbers) {
    std::string unique = Unique(name);
    FillTensor(unique, static_cast<int>(NumberType::kFloat), shape, numbers,
               graph_.add_initializer());
    return unique;
  }

  Value Integers(const std::vector<std::int64_t>& numbers) {
    std::string unique = Unique("integers");
    FillTensor<std::int64_t>(unique, kInt64, {static_cast<std::int64_t>(numbers.size())}, numbers,
                             graph_.add_initializer());
    return unique;
  }

  /// Adds a node with one output, and returns that.
  Value Add(const char* operation, const std::vector<Value>& inputs,
            const std::vector<Attribute>& attributes = {}) {
    std::string unique = Unique(operation);
    wire::NodeProto* const node = graph_.add_node();
    node->set_op_type(operation);
    node->set_name(unique);
    for (const Value& input : inputs) node->add_input(input);
    node->add_output(unique);
    for (const Attribute& attribute : attributes) FillAttribute(attribute, node->add_attribute());
    return unique;
  }

  /// The model's bytes, with `metadata` beside the graph.
  std::string Print(std::string_view graph_name,
                    const std::map<std::string, std::string>& metadata) {
    proto_.set_ir_version(kIrVersion);
    proto_.set_producer_name("slalom");
    proto_.set_producer_version(std::string(base::Version()));
    proto_.add_opset_import()->set_version(kOperatorSet);
    graph_.set_name(std::string(graph_name));
    for (const auto& [key, value] : metadata) {
      wire::StringStringEntryProto* const entry = proto_.add_metadata_props();
      entry->set_key(key);
      entry->set_value(value);
    }
    return proto_.SerializeAsString();
  }

 private:
  /// NAME, NAME_1, NAME_2, ...: each value of a graph has a name of its own.
  std::string Unique(std::string_view name) {
    int& count = num_named_.try_emplace(std::string(name), 0).first->second;
    const int i = count++;
    return i == 0 ? std::string(name) : fmt::format("{}_{}", name, i);
  }

  wire::ModelProto proto_;
  wire::GraphProto& graph_ = *proto_.mutable_graph();
  std::map<std::string, int, std::less<>> num_named_;
};

using Integers = std::vector<std::int64_t>;

constexpr std::int64_t kEnd = std::numeric_limits<std::int64_t>::max();  // End of an axis.

/// The last action with which an episode begins, as JSON.
std::string Standstill(const PolicySpec& spec) {
  const env::Action action = spec.actions.Standstill();
  return fmt::format("[{}, {}]", action.linear, action.angular);
}

class ModelPrinter {
 public:
  explicit ModelPrinter(const PolicySnapshot& snapshot)
      : spec_(snapshot.spec),
        shape_(spec_.actor_shape()),
        slots_(shape_.Slots()),
        weights_(*snapshot.weights),
        history_(spec_.network.history),
        frame_size_(shape_.frame_size),
        num_ranges_(frame_size_ - spec_.observation.state_size) {}

  std::string Print(const nn::Metadata& metadata) {
    const Value features = Encode(History(Frame()));
    Command(Head(features));
    return graph_.Print("policy", metadata);
  }

 private:
  const nn::ParameterSlot& Slot(const std::string& name) const {
    return nn::FindSlot(slots_, name);
  }
  std::span<const float> Numbers(const nn::ParameterSlot& slot) const {
    return weights_.subspan(slot.offset, slot.size());
  }

  /// A parameter as it is stored.
  Value Parameter(const std::string& name) {
    const nn::ParameterSlot& slot = Slot(name);
    return graph_.Tensor(name, slot.shape, Numbers(slot));
  }

  /// A parameter [O, J, I] as [O, I, J].
  Value Transposed(const std::string& name, std::int64_t outer, std::int64_t rows,
                   std::int64_t columns) {
    const std::span<const float> numbers = Numbers(Slot(name));
    std::vector<float> turned(numbers.size());
    for (std::int64_t o = 0; o < outer; ++o) {
      for (std::int64_t j = 0; j < rows; ++j) {
        for (std::int64_t i = 0; i < columns; ++i) {
          turned[(o * columns + i) * rows + j] = numbers[(o * rows + j) * columns + i];
        }
      }
    }
    return graph_.Tensor(
        name, outer == 1 ? Integers{columns, rows} : Integers{outer, columns, rows}, turned);
  }

  /// x: [..., I] -> [..., O]
  Value Linear(const Value& x, const std::string& name) {
    const nn::ParameterSlot& weight = Slot(name + ".weight");
    const std::int64_t outputs = weight.shape[0];
    const Value matrix = Transposed(weight.name, 1, outputs, weight.size() / outputs);
    return graph_.Add("Add", {graph_.Add("MatMul", {x, matrix}), Parameter(name + ".bias")});
  }

  Value Relu(const Value& x) { return graph_.Add("Relu", {x}); }
  Value Transpose(const Value& x, const Integers& order) {
    return graph_.Add("Transpose", {x}, {{"perm", order}});
  }
  /// A size of 0 stands for the size that x has there.
  Value Reshape(const Value& x, const Integers& shape) {
    return graph_.Add("Reshape", {x, graph_.Integers(shape)});
  }
  Value Slice(const Value& x, std::int64_t axis, std::int64_t begin, std::int64_t end) {
    return graph_.Add(
        "Slice", {x, graph_.Integers({begin}), graph_.Integers({end}), graph_.Integers({axis})});
  }
  Value Concatenate(const std::vector<Value>& parts, std::int64_t axis) {
    return graph_.Add("Concat", parts, {{"axis", axis}});
  }
  /// The last of an axis, which is taken away.
  Value Last(const Value& x, std::int64_t axis) {
    return graph_.Add("Squeeze", {Slice(x, axis, -1, kEnd), graph_.Integers({axis})});
  }

  std::string StateMeaning() const {
    std::string text;
    for (const env::StateField& field : env::kStateFields) {
      if (field.num_items(spec_.observation) == 0) continue;
      text += fmt::format("{}{}", text.empty() ? "" : "; ", field.meaning);
      if (field.name == "last action") {
        text += fmt::format(", at first {}, which commands standing still", Standstill(spec_));
      }
    }
    return text;
  }

  /// Scan and state -> [B, F], as `nn::FeatureMap` writes them.
  Value Frame() {
    const int num_beams = spec_.observation.num_beams;
    Value ranges = graph_.AddInput({"ranges",
                                    NumberType::kUint16,
                                    {num_beams},
                                    fmt::format("LiDAR readings, counter-clockwise (from right to "
                                                "left), in cm; no echo: {:.0f} or more",
                                                100.0 * spec_.observation.range_clip)});
    const Value state = graph_.AddInput(
        {"state", NumberType::kFloat, {spec_.observation.state_size}, StateMeaning()});
    ranges = graph_.Add("Cast", {ranges}, {{"to", static_cast<std::int64_t>(NumberType::kFloat)}});
    if (num_ranges_ != num_beams) {
      ranges = graph_.Add("ReduceMin", {Reshape(ranges, {0, num_ranges_, num_beams / num_ranges_})},
                          {{"axes", Integers{2}}, {"keepdims", std::int64_t{0}}});
    }
    const float clip_cm = static_cast<float>(100.0 * spec_.observation.range_clip);
    ranges = graph_.Add("Min", {ranges, graph_.Number(clip_cm)});
    if (spec_.network.range_transform == nn::RangeTransform::kInverse) {
      ranges = Affine(ranges, graph_.Number(0.01f), graph_.Number(0.2f));
      ranges = graph_.Add("Sub",
                          {graph_.Add("Div", {graph_.Number(0.6f), ranges}), graph_.Number(0.8f)});
    } else {
      ranges = Affine(ranges, graph_.Number(2.0f / clip_cm), graph_.Number(-1.0f));
    }
    if (spec_.network.goal_transform == nn::GoalTransform::kBounded) {
      const Value goal = Slice(state, 1, 0, 2);
      const Value distance =
          graph_.Add("ReduceL2", {goal}, {{"axes", Integers{1}}, {"keepdims", std::int64_t{1}}});
      const Value scale = graph_.Add(
          "Add", {distance, graph_.Number(static_cast<float>(spec_.observation.goal_scale))});
      return Concatenate({ranges, graph_.Add("Div", {goal, scale}), Slice(state, 1, 2, kEnd)}, 1);
    }
    const float scale = static_cast<float>(1.0 / spec_.observation.goal_scale);
    const float y = spec_.network.goal_transform == nn::GoalTransform::kCentred ? 0.0f : -1.0f;
    const std::int64_t size = spec_.observation.state_size;
    std::vector<float> scales(static_cast<std::size_t>(size), 1.0f);
    scales[0] = scales[1] = scale;
    std::vector<float> offsets(static_cast<std::size_t>(size), 0.0f);
    offsets[0] = -1.0f;
    offsets[1] = y;
    const Value rest = Affine(state, graph_.Tensor("state.scale", {size}, scales),
                              graph_.Tensor("state.offset", {size}, offsets));
    return Concatenate({ranges, rest}, 1);
  }

  Value Affine(const Value& x, const Value& scale, const Value& offset) {
    return graph_.Add("Add", {graph_.Add("Mul", {x, scale}), offset});
  }

  /// The newest frame [B, F] -> the stack [B, H, F], as `nn::FeatureMap::PushFrames` keeps it.
  Value History(const Value& frame) {
    Value newest = graph_.Add("Unsqueeze", {frame, graph_.Integers({1})});
    if (history_ == 1) return newest;
    const Port frames = {"frames",
                         NumberType::kFloat,
                         {history_, frame_size_},
                         "the frames_after of the step before, the newest last; any where "
                         "first is true"};
    const Value before = graph_.AddInput(frames);
    const Value first =
        graph_.AddInput({"first",
                         NumberType::kBool,
                         {},
                         "whether an episode begins, so that the past is forgotten"});
    const Value moved = Concatenate({Slice(before, 1, 1, kEnd), newest}, 1);
    const Value fresh = graph_.Add("Expand", {newest, graph_.Integers({1, history_, 1})});
    Value stack = graph_.Add("Where", {Reshape(first, {-1, 1, 1}), fresh, moved});
    graph_.AddOutput({"frames_after", frames.type, frames.shape, "the frames of the next step"},
                     stack);
    return stack;
  }

  /// [B, H, F] -> the head's input, [B, W].
  Value Encode(const Value& stack) {
    switch (shape_.encoder) {
      case nn::EncoderKind::kMlp:
        break;
      case nn::EncoderKind::kTimeCnn:
        return TimeCnn(stack);
      case nn::EncoderKind::kBeamCnn:
        return BeamCnn(stack);
      case nn::EncoderKind::kGru:
        return Gru(stack);
      case nn::EncoderKind::kTransformer:
        return Transformer(stack);
    }
    return Reshape(stack, {0, history_ * frame_size_});
  }

  Value TimeCnn(const Value& stack) {
    const Integers& sizes = Slot("encoder.0.weight").shape;  // [V, 3, F]
    const Value kernel = Transposed("encoder.0.weight", sizes[0], sizes[1], sizes[2]);
    const Value hidden =
        Relu(graph_.Add("Conv", {Transpose(stack, {0, 2, 1}), kernel, Parameter("encoder.0.bias")},
                        {{"pads", Integers{1, 1}}}));  // [B, V, H]
    return Relu(
        Linear(Reshape(Transpose(hidden, {0, 2, 1}), {0, history_ * sizes[0]}), "encoder.1"));
  }

  Value BeamCnn(const Value& stack) {
    Value channels = Slice(stack, 2, 0, num_ranges_);
    const auto layers = nn::BeamConvolutions(spec_.network, frame_size_);
    for (std::size_t i = 0; i < layers.size(); ++i) {
      const nn::BeamConvolution& layer = layers[i];
      const std::string name = fmt::format("encoder.{}", i);
      const Value kernel =
          Transposed(name + ".weight", layer.out_channels, layer.width, layer.in_channels);
      const Value bias = Parameter(name + ".bias");
      channels = Relu(graph_.Add("Conv", {channels, kernel, bias},
                                 {{"strides", Integers{layer.stride}}}));  // [B, C, positions]
    }
    const std::int64_t numbers =
        static_cast<std::int64_t>(layers.back().out_positions) * layers.back().out_channels;
    const Value flat = Reshape(Transpose(channels, {0, 2, 1}), {0, numbers});
    const Value states =
        Reshape(Slice(stack, 2, num_ranges_, kEnd), {0, history_ * env::kStateSize});
    return Relu(Linear(Concatenate({flat, states}, 1), fmt::format("encoder.{}", layers.size())));
  }

  Value Gru(const Value& stack) {
    Value steps = Transpose(stack, {1, 0, 2});  // [H, B, F]
    for (std::size_t i = 0; i < spec_.network.encoder_layers.size(); ++i) {
      const std::int64_t width = spec_.network.encoder_layers[i];
      const std::string layer = fmt::format("encoder.{}.", i);
      std::vector<float> biases;
      for (const char* part : {"input.bias", "state.bias"}) {
        const std::vector<float> gates = GatesOf(Slot(fmt::format("{}{}", layer, part)), width);
        biases.insert(biases.end(), gates.begin(), gates.end());
      }
      const auto weight = [&](const std::string& name) {
        const nn::ParameterSlot& slot = Slot(layer + name);
        return graph_.Tensor(slot.name, {1, slot.shape[0], slot.shape[1]}, GatesOf(slot, width));
      };
      const Value outputs =
          graph_.Add("GRU",
                     {steps, weight("input.weight"), weight("state.weight"),
                      graph_.Tensor(layer + "bias", {1, 6 * width}, biases)},
                     {{"hidden_size", width}, {"linear_before_reset", std::int64_t{1}}});
      steps = graph_.Add("Squeeze", {outputs, graph_.Integers({1})});  // From [H, 1, B, W]
    }
    return Last(steps, 0);
  }

  /// A parameter of gates [3 W, ...] in ONNX's order, update, reset, new, from ours: reset, update,
  /// new.
  std::vector<float> GatesOf(const nn::ParameterSlot& slot, std::int64_t width) const {
    const std::span<const float> from = Numbers(slot);
    const std::int64_t gate = width * slot.size() / slot.shape[0];
    std::vector<float> to(from.begin(), from.end());
    std::copy_n(from.begin() + gate, gate, to.begin());
    std::copy_n(from.begin(), gate, to.begin() + gate);
    return to;
  }

  Value Norm(const Value& x, const std::string& name) {
    return graph_.Add("LayerNormalization",
                      {x, Parameter(name + ".weight"), Parameter(name + ".bias")},
                      {{"epsilon", 1e-5f}});
  }

  Value Transformer(const Value& stack) {
    Value stream =
        graph_.Add("Add", {Linear(stack, "encoder.embedding"), Parameter("encoder.time")});
    stream = Norm(stream, "encoder.embedding.norm");  // [B, H, W]
    for (std::size_t i = 0; i < spec_.network.encoder_layers.size(); ++i) {
      stream = Block(stream, fmt::format("encoder.{}.", i));
    }
    return Norm(Last(stream, 1), "encoder.norm");
  }

  /// [B, H, W] -> [B, H, W]
  Value Block(const Value& stream, const std::string& name) {
    const Value attended = Attend(Norm(stream, name + "attention.norm"), name + "attention.");
    const Value middle = graph_.Add("Add", {stream, attended});
    const Value up = Linear(Norm(middle, name + "mlp.norm"), name + "mlp.0");
    return graph_.Add("Add", {middle, Linear(Gelu(up), name + "mlp.1")});
  }

  /// Causal attention over the frames, [B, H, W] -> [B, H, W].
  Value Attend(const Value& x, const std::string& name) {
    const std::int64_t width = spec_.network.encoder_layers.front();
    const std::int64_t heads = spec_.network.attention_heads;
    const std::int64_t head_width = width / heads;
    const Value products = Linear(x, name + "query_key_value");
    const auto split = [&](std::int64_t part, const Integers& order) {
      const Value columns = Slice(products, 2, part * width, (part + 1) * width);
      return Transpose(Reshape(columns, {0, history_, heads, head_width}), order);
    };
    const Value query = split(0, {0, 2, 1, 3});
    const Value key = split(1, {0, 2, 3, 1});
    const Value value = split(2, {0, 2, 1, 3});
    const float scale = 1.0f / std::sqrt(static_cast<float>(head_width));
    std::vector<float> mask(static_cast<std::size_t>(history_ * history_));
    for (std::int64_t t = 0; t < history_; ++t) {
      for (std::int64_t later = t + 1; later < history_; ++later) {
        mask[t * history_ + later] = -std::numeric_limits<float>::infinity();
      }
    }
    const Value scores = Affine(graph_.Add("MatMul", {query, key}), graph_.Number(scale),
                                graph_.Tensor("mask", {history_, history_}, mask));
    const Value weights = graph_.Add("Softmax", {scores}, {{"axis", std::int64_t{-1}}});
    const Value attended = Transpose(graph_.Add("MatMul", {weights, value}), {0, 2, 1, 3});
    return Linear(Reshape(attended, {0, history_, width}), name + "output");
  }

  /// GPT-2's form of GELU (nn::Gelu).
  Value Gelu(const Value& x) {
    const Value cube = graph_.Add("Mul", {graph_.Add("Mul", {x, x}), x});
    const Value inner = graph_.Add("Add", {x, graph_.Add("Mul", {cube, graph_.Number(0.044715f)})});
    const Value tanh = graph_.Add(
        "Tanh", {graph_.Add("Mul", {inner, graph_.Number(std::sqrt(2.0f / 3.14159265f))})});
    const Value half = graph_.Number(0.5f);
    return graph_.Add("Mul", {x, Affine(tanh, half, half)});
  }

  /// [B, W] -> the distribution's parameters.
  Value Head(Value x) {
    const nn::MlpShape& mlp = shape_.mlp;
    for (int i = 0; i < mlp.num_layers(); ++i) {
      x = Linear(x, mlp.layer_name(i));
      if (i + 1 < mlp.num_layers()) x = Relu(x);
    }
    return x;
  }

  void Command(const Value& outputs) {
    // Means come first; all other outputs are for exploration only.
    const Value action = graph_.Add("Tanh", {Slice(outputs, 1, 0, env::kActionSize)});
    const env::ActionBounds& bounds = spec_.actions;
    const float middle = static_cast<float>(bounds.linear_mps({}));
    const float half = static_cast<float>(bounds.linear_max) - middle;
    const Value command =
        Affine(action,
               graph_.Tensor("command.scale", {2},
                             std::array{half, static_cast<float>(bounds.angular_max)}),
               graph_.Tensor("command.offset", {2}, std::array{middle, 0.0f}));
    graph_.AddOutput({"command",
                      NumberType::kFloat,
                      {env::kActionSize},
                      "speed in m/s, turn rate in rad/s (to the left)"},
                     command);
    graph_.AddOutput({"action",
                      NumberType::kFloat,
                      {env::kActionSize},
                      "the same in [-1, 1], for the state of the next step"},
                     action);
  }

  const PolicySpec& spec_;
  const nn::NetworkShape shape_;
  const std::vector<nn::ParameterSlot> slots_;
  const std::span<const float> weights_;
  const std::int64_t history_;     // H
  const std::int64_t frame_size_;  // F
  const std::int64_t num_ranges_;  // R
  GraphBuilder graph_;
};

}  // namespace

std::string PrintOnnx(const PolicySnapshot& snapshot, const nn::Metadata& metadata) {
  base::ThrowIf(
      snapshot.spec.network.dropout_everywhere,
      "network.dropout_everywhere is true, expected false: the policy drops units at random when "
      "it acts, which an ONNX model cannot do as it does");
  snapshot.spec.RequireCourses("an ONNX model");
  nn::Metadata all = metadata;
  all["slalom_policy"] = PrintSpec(snapshot.spec, snapshot.version);
  all["standstill"] = Standstill(snapshot.spec);
  return ModelPrinter(snapshot).Print(all);
}

}  // namespace slalom::policy
