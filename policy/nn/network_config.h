#pragma once

#include <vector>

#include "base/check.h"
#include "base/config_field.h"

namespace slalom::nn {

/// The families that `network.encoder` names.
enum class EncoderFamily { kMlp, kCnn, kGru, kTransformer };
inline base::OneOf EnumNames(EncoderFamily) { return {"mlp", "cnn", "gru", "transformer"}; }

/// The axis along which a cnn convolves.
enum class CnnAxis { kTime, kBeams };
inline base::OneOf EnumNames(CnnAxis) { return {"time", "beams"}; }

/// How a range is scaled.
enum class RangeTransform { kLinear, kInverse };
inline base::OneOf EnumNames(RangeTransform) { return {"linear", "inverse"}; }

/// How the goal's coordinates are scaled.
enum class GoalTransform { kLinear, kCentred, kBounded };
inline base::OneOf EnumNames(GoalTransform) { return {"linear", "centred", "bounded"}; }

/// Settings of an actor's or critic's network. The defaults are the paper's
/// (docs/original-system.md, section 3.3). Part of every saved policy.
///
/// Actor: encoder -> head -> 2 outputs, tanh. Critic: encoder, then the action beside its features
/// -> head -> 1; without encoder layers the action stands beside the input itself. docs/networks.md
/// has the encoders' formulas. `CheckNetwork` refuses settings that do not make a network.
struct NetworkConfig {
  EncoderFamily encoder = EncoderFamily::kMlp;
  std::vector<int> encoder_layers = {512, 512};
  CnnAxis cnn_axis = CnnAxis::kTime;
  int attention_heads = 8;
  double dropout = 0.0;
  bool dropout_everywhere = false;
  std::vector<int> head_layers = {512, 512};
  int history = 1;
  int sectors = 0;
  RangeTransform range_transform = RangeTransform::kLinear;
  GoalTransform goal_transform = GoalTransform::kLinear;
  bool layer_norm = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf for_transformer{"encoder", {"transformer"}};
    v("encoder", encoder, "The network that reads the observed frames (docs/networks.md).");
    v("encoder_layers", encoder_layers, base::Range{1, 8192}, "",
      "Widths of the encoder's layers. mlp: ReLU layers, [] for none. cnn: two convolutions over "
      "time, or convolutions over beams and a last layer. gru: one width per layer. transformer: "
      "one width per block, all equal.");
    v("cnn_axis", cnn_axis,
      "The axis along which a cnn convolves: time, as in the paper, or the beams.",
      base::ReadIf{"encoder", {"cnn"}});
    v("attention_heads", attention_heads, base::Range{1, 256}, "",
      "Attention heads of a transformer; must divide its width.", for_transformer);
    v("dropout", dropout, base::Range{0.0, 0.9}, "",
      "Share of a transformer's embeddings, attention weights and residuals that is dropped in "
      "training.",
      for_transformer);
    v("dropout_everywhere", dropout_everywhere,
      "Apply dropout in the target networks and when acting, too, as the paper's code does.",
      for_transformer);
    v("head_layers", head_layers, base::Range{1, 8192}, "",
      "Widths of the head's ReLU layers; [] for none.");
    v("history", history, base::Range{1, 64}, "frames",
      "Successive frames that the networks see at once, the newest last.");
    v("sectors", sectors, base::Range{0, 4096}, "",
      "Sectors into which a scan is divided; the networks see the nearest range of each. Must "
      "divide the number of beams. 0: they see every beam.");
    v("range_transform", range_transform,
      "How a range r in metres is scaled. linear: from -1 at 0 to +1 at range_clip, as it is "
      "observed. inverse: 0.6 / (r + 0.2) - 0.8, which resolves near ranges more finely.");
    v("goal_transform", goal_transform,
      "How the goal's coordinates are scaled. linear: x / goal_scale - 1 and y / goal_scale - 1, "
      "as they are observed. centred: x / goal_scale - 1 and y / goal_scale, so that left and "
      "right are mirror images. bounded: x / (d + goal_scale) and y / (d + goal_scale) at the "
      "distance d, so that both stay between -1 and 1 at any distance.");
    v("layer_norm", layer_norm, "LayerNorm before each ReLU of the critics.");
  }

  friend bool operator==(const NetworkConfig&, const NetworkConfig&) = default;
};

/// The encoders. Each has a source in policy/nn/inference/ (its parameters, and how it acts without
/// LibTorch) and one in policy/nn/ (how it is trained), which define the functions that are
/// declared with `SLALOM_FOR_EACH_ENCODER`.
enum class EncoderKind {
  kMlp,  ///< No encoder of its own: the layers belong to the head.
  kTimeCnn,
  kBeamCnn,
  kGru,
  kTransformer,
};

/// The encoder that a config names.
inline EncoderKind EncoderOf(const NetworkConfig& config) {
  switch (config.encoder) {
    case EncoderFamily::kMlp:
      break;
    case EncoderFamily::kCnn:
      return config.cnn_axis == CnnAxis::kBeams ? EncoderKind::kBeamCnn : EncoderKind::kTimeCnn;
    case EncoderFamily::kGru:
      return EncoderKind::kGru;
    case EncoderFamily::kTransformer:
      return EncoderKind::kTransformer;
  }
  return EncoderKind::kMlp;
}

/// Lists the encoders other than kMlp, to declare a function for each: `declare` is a macro of one
/// enumerator.
#define SLALOM_FOR_EACH_ENCODER(declare) \
  declare(kTimeCnn) declare(kBeamCnn) declare(kGru) declare(kTransformer)

/// Calls `f.operator()<kind>()`. Requires: an encoder other than kMlp.
template <class F>
auto DispatchEncoder(EncoderKind kind, const F& f) {
  switch (kind) {
    case EncoderKind::kMlp:
      break;
#define SLALOM_CASE(k) \
  case EncoderKind::k: \
    return f.template operator()<EncoderKind::k>();
      SLALOM_FOR_EACH_ENCODER(SLALOM_CASE)
#undef SLALOM_CASE
  }
  base::CheckFailed(__FILE__, __LINE__, "an mlp has no encoder of its own");
}

}  // namespace slalom::nn
