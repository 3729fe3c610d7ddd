#include "policy/onnx/graph_builder.h"

#include <fmt/format.h>

#include <bit>

#include "base/version.h"
#include "policy/onnx/onnx.pb.h"

namespace slalom::policy::onnx {
namespace {

namespace wire = slalom::onnx;

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
  for (const std::int64_t size : port.shape)
    tensor->mutable_shape()->add_dim()->set_dim_value(size);
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

}  // namespace

struct GraphBuilder::Model {
  wire::ModelProto proto;
  wire::GraphProto* graph = proto.mutable_graph();
};

GraphBuilder::GraphBuilder() : model_(std::make_unique<Model>()) {}

GraphBuilder::~GraphBuilder() = default;

std::string GraphBuilder::Unique(std::string_view name) {
  int& count = num_named_.try_emplace(std::string(name), 0).first->second;
  const int i = count++;
  return i == 0 ? std::string(name) : fmt::format("{}_{}", name, i);
}

Value GraphBuilder::AddInput(const Port& port) {
  FillPort(port, model_->graph->add_input());
  return Unique(port.name);
}

void GraphBuilder::AddOutput(const Port& port, const Value& value) {
  FillPort(port, model_->graph->add_output());
  wire::NodeProto* const node = model_->graph->add_node();
  node->set_op_type("Identity");
  node->set_name(Unique("Identity"));
  node->add_input(value);
  node->add_output(port.name);
}

Value GraphBuilder::Tensor(std::string_view name, const std::vector<std::int64_t>& shape,
                           std::span<const float> numbers) {
  std::string unique = Unique(name);
  FillTensor(unique, static_cast<int>(NumberType::kFloat), shape, numbers,
             model_->graph->add_initializer());
  return unique;
}

Value GraphBuilder::Integers(const std::vector<std::int64_t>& numbers) {
  std::string unique = Unique("integers");
  FillTensor<std::int64_t>(unique, kInt64, {static_cast<std::int64_t>(numbers.size())}, numbers,
                           model_->graph->add_initializer());
  return unique;
}

Value GraphBuilder::Add(const char* operation, const std::vector<Value>& inputs,
                        const std::vector<Attribute>& attributes) {
  std::string unique = Unique(operation);
  wire::NodeProto* const node = model_->graph->add_node();
  node->set_op_type(operation);
  node->set_name(unique);
  for (const Value& input : inputs) node->add_input(input);
  node->add_output(unique);
  for (const Attribute& attribute : attributes) FillAttribute(attribute, node->add_attribute());
  return unique;
}

std::string GraphBuilder::Print(std::string_view graph_name,
                                const std::map<std::string, std::string>& metadata) {
  wire::ModelProto& proto = model_->proto;
  proto.set_ir_version(kIrVersion);
  proto.set_producer_name("slalom");
  proto.set_producer_version(std::string(base::Version()));
  proto.add_opset_import()->set_version(kOperatorSet);
  model_->graph->set_name(std::string(graph_name));
  for (const auto& [key, value] : metadata) {
    wire::StringStringEntryProto* const entry = proto.add_metadata_props();
    entry->set_key(key);
    entry->set_value(value);
  }
  return proto.SerializeAsString();
}

}  // namespace slalom::policy::onnx
