#include "benchmarks/network_products.h"

#include "benchmarks/thread_seconds.h"
#include "env/observation.h"
#include "policy/nn/encoder_slots.h"
#include "policy/nn/kernels/blas.h"
#include "policy/nn/kernels/small_gemm.h"

namespace slalom {
namespace {

/// `count` layers y = x w^T: x [m, k], w [n, k].
struct Layer {
  std::int64_t m, n, k;
  double count = 1.0;
  bool first = false;  // Nobody asks for the gradient by its input.
};

std::vector<Layer> GruLayers(const nn::NetworkShape& shape, std::int64_t batch) {
  const std::int64_t history = shape.config.history;
  std::vector<Layer> layers;
  std::int64_t inputs = shape.frame_size;
  for (const std::int64_t width : shape.config.encoder_layers) {
    layers.push_back({batch * history, 3 * width, inputs, 1.0, layers.empty()});
    layers.push_back({batch, 3 * width, width, static_cast<double>(history - 1)});
    inputs = width;
  }
  return layers;
}

std::vector<Layer> TransformerLayers(const nn::NetworkShape& shape, std::int64_t batch) {
  const std::int64_t rows = batch * shape.config.history;
  const std::int64_t width = shape.config.encoder_layers.back();
  std::vector<Layer> layers = {{rows, width, shape.frame_size, 1.0, true}};
  for (std::size_t block = 1; block < shape.config.encoder_layers.size(); ++block) {
    layers.insert(layers.end(), {{rows, 3 * width, width},
                                 {rows, width, width},
                                 {rows, 4 * width, width},
                                 {rows, width, 4 * width}});
  }
  layers.insert(layers.end(), {{rows, 2 * width, width},  // The last: keys and values of all,
                               {batch, width, width, 2},  // the rest of the newest.
                               {batch, 4 * width, width},
                               {batch, width, 4 * width}});
  return layers;
}

std::vector<Layer> TimeCnnLayers(const nn::NetworkShape& shape, std::int64_t batch) {
  const std::int64_t history = shape.config.history, frame = shape.frame_size;
  const std::int64_t first = shape.config.encoder_layers[0],
                     second = shape.config.encoder_layers[1];
  // Windows of three frames; those at both ends have one less.
  return {{batch, first, 3 * frame, static_cast<double>(history - 2), true},
          {batch, first, history == 1 ? frame : 2 * frame, history == 1 ? 1.0 : 2.0, true},
          {batch, second, history * first}};
}

std::vector<Layer> BeamCnnLayers(const nn::NetworkShape& shape, std::int64_t batch) {
  const std::vector<nn::BeamConvolution> convolutions =
      nn::BeamConvolutions(shape.config, shape.frame_size);
  std::vector<Layer> layers;
  for (const nn::BeamConvolution& c : convolutions) {
    layers.push_back(
        {batch * c.out_positions, c.out_channels, c.width * c.in_channels, 1.0, layers.empty()});
  }
  const nn::BeamConvolution& last = convolutions.back();
  layers.push_back({batch, shape.config.encoder_layers.back(),
                    last.out_positions * last.out_channels +
                        shape.config.history * static_cast<int>(env::kStateSize)});
  return layers;
}

std::vector<Layer> EncoderLayers(const nn::NetworkShape& shape, std::int64_t batch) {
  switch (shape.encoder) {
    case nn::EncoderKind::kMlp:
      return {};  // Its layers are all in shape.mlp.
    case nn::EncoderKind::kTimeCnn:
      return TimeCnnLayers(shape, batch);
    case nn::EncoderKind::kBeamCnn:
      return BeamCnnLayers(shape, batch);
    case nn::EncoderKind::kGru:
      return GruLayers(shape, batch);
    case nn::EncoderKind::kTransformer:
      return TransformerLayers(shape, batch);
  }
  return {};
}

std::vector<Layer> Layers(const nn::NetworkShape& shape, std::int64_t batch) {
  std::vector<Layer> layers = EncoderLayers(shape, batch);
  for (int i = 0; i < shape.mlp.num_layers(); ++i) {
    layers.push_back({batch, shape.mlp.layer_outputs(i), shape.mlp.layer_inputs(i), 1,
                      i == 0 && !shape.has_encoder()});
  }
  std::erase_if(layers, [](const Layer& layer) { return layer.count <= 0.0; });
  return layers;
}

}  // namespace

Products ForwardProducts(const nn::NetworkShape& shape, std::int64_t batch) {
  Products products;
  for (const Layer& layer : Layers(shape, batch)) {
    products.push_back({layer.m, layer.n, layer.k, layer.count});
  }
  return products;
}

Products BackwardProducts(const nn::NetworkShape& shape, std::int64_t batch) {
  Products products;
  for (const Layer& layer : Layers(shape, batch)) {
    products.push_back({layer.n, layer.k, layer.m, layer.count});
    if (!layer.first) products.push_back({layer.m, layer.k, layer.n, layer.count});
  }
  return products;
}

Products ActionGradientProducts(const nn::NetworkShape& shape, std::int64_t batch) {
  const nn::MlpShape& head = shape.mlp;
  Products products = {{batch, head.num_extra, head.layer_outputs(head.extra_layer), 1.0}};
  for (int i = head.extra_layer + 1; i < head.num_layers(); ++i) {
    products.push_back({batch, head.layer_inputs(i), head.layer_outputs(i), 1.0});
  }
  return products;
}

void Add(const Products& more, double times, Products* products) {
  for (Product product : more) {
    product.count *= times;
    products->push_back(product);
  }
}

double CountFlops(const Products& products) {
  double flops = 0.0;
  for (const Product& p : products) flops += p.count * 2.0 * static_cast<double>(p.m * p.n * p.k);
  return flops;
}

double MeasureProducts(const Products& products, bool small_gemm, double seconds_each) {
  const nn::CpuFeatures cpu = nn::DetectCpuFeatures();
  double total = 0.0;
  for (const Product& p : products) {
    std::vector<float> a(p.m * p.k, 0.5f), b(p.k * p.n, 0.5f), c(p.m * p.n);
    const nn::GemmTask task{.m = p.m,
                            .n = p.n,
                            .k = p.k,
                            .a = a.data(),
                            .lda = p.k,
                            .b = b.data(),
                            .ldb = p.n,
                            .c = c.data(),
                            .ldc = p.n};
    const auto multiply = [&] {
      if (small_gemm && nn::SmallGemm(task, cpu)) return;
      nn::Sgemm(false, false, p.m, p.n, p.k, a.data(), p.k, b.data(), p.n, c.data(), p.n);
    };
    multiply();
    int count = 0;
    const double begin = ThreadSeconds();
    double elapsed = 0.0;
    while (elapsed < seconds_each) {
      // Several to a reading of the clock, which takes longer than a tenth of the smallest.
      for (int i = 0; i < 8; ++i) multiply();
      count += 8;
      elapsed = ThreadSeconds() - begin;
    }
    total += p.count * elapsed / count;
  }
  return total;
}

}  // namespace slalom
