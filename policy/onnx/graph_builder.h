#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace slalom::policy::onnx {

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

/// Builds an ONNX model of operator set 17, node by node. Confined to one thread.
class GraphBuilder {
 public:
  GraphBuilder();
  ~GraphBuilder();

  Value AddInput(const Port& port);
  /// Makes `value` an output of the graph, under the port's name.
  void AddOutput(const Port& port, const Value& value);

  /// Constants. The product of `shape` is the number of `numbers`.
  Value Number(float number) { return Tensor("number", {}, {&number, 1}); }
  Value Tensor(std::string_view name, const std::vector<std::int64_t>& shape,
               std::span<const float> numbers);
  Value Integers(const std::vector<std::int64_t>& numbers);

  /// Adds a node with one output, and returns that.
  Value Add(const char* operation, const std::vector<Value>& inputs,
            const std::vector<Attribute>& attributes = {});

  /// The model's bytes, with `metadata` beside the graph.
  std::string Print(std::string_view graph_name,
                    const std::map<std::string, std::string>& metadata);

 private:
  struct Model;

  /// NAME, NAME_1, NAME_2, ...: each value of a graph has a name of its own.
  std::string Unique(std::string_view name);

  std::unique_ptr<Model> model_;
  std::map<std::string, int, std::less<>> num_named_;
};

}  // namespace slalom::policy::onnx
