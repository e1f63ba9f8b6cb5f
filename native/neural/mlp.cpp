// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/mlp.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "neural/layers.h"
#include "neural/mlp_sweep.h"
#include "tensors/device.h"
#include "tensors/operations.h"

namespace arapfields {

struct Mlp::State {
  MlpShape shape;
  Tensor parameters, gradient;
  LayerViews layers;   // into parameters
  LayerViews trained;  // what forward() and pull_back() use: the same, perhaps with rounded copies
  // Of the last forward call:
  Blocks kept;
  std::vector<GradientPart> parts;  // the first is the gradient itself
  Tensor result;
  bool fresh = false;

  void prepare(const Tensor& points, JetOrder order);
};

namespace {

void check_points(const Tensor& points, const Tensor& like) {
  require(points.dims() == 2 && points.size(1) == 3 && points.is_contiguous() && alike(points, like),
          "points", "another shape, dtype or device",
          "expected a contiguous (n,3) tensor like the parameters");
}

/// Numbers that forward() keeps for pull_back().
double kept_numbers(const MlpShape& shape, Index n, JetOrder order) {
  const int activations = std::min(columns(order), 4) + 1 + (order == JetOrder::second ? shape.outputs : 0);
  return static_cast<double>(n) * shape.layers * activations * shape.width;
}

const Block& largest_of(const std::vector<Block>& blocks) {
  return *std::max_element(blocks.begin(), blocks.end(),
                           [](const Block& a, const Block& b) { return a.count < b.count; });
}

}  // namespace

void Mlp::State::prepare(const Tensor& points, JetOrder order) {
  const Index n = points.size(0);
  const bool same = result.defined() && result.size(0) == columns(order) && result.size(1) == n &&
                    static_cast<int>(kept.workspaces.size()) >= sweep_threads(parameters, kept.blocks.size());
  if (same) return;
  kept = {};  // frees before it allocates
  if (parameters.on_host())
    require_memory("batch",
                   kept_numbers(shape, n, order) * (parameters.is_double() ? sizeof(double) : sizeof(float)));
  kept.blocks = split_points(n, order, !on_device_path(parameters));
  for (Block& block : kept.blocks) allocate(shape, parameters, true, block);
  for (int t = sweep_threads(parameters, kept.blocks.size()); t > 0; --t)
    kept.workspaces.push_back(make_workspace(shape, parameters, largest_of(kept.blocks)));
  parts.clear();
  for (Index g = 0; g < kept.gradient_groups(); ++g) {
    const Tensor flat = g == 0 ? gradient : empty_like(gradient);
    parts.push_back({flat, LayerViews(shape, flat)});
  }
  result = empty({columns(order), n, shape.outputs}, parameters);
}

Mlp::Mlp(const MlpShape& shape, std::uint64_t seed, bool zero_last_layer, bool double_precision,
         const std::string& device) {
  validate(shape);
  const ThreadScope scope;
  const Index count = parameter_count(shape);
  require_memory("width", static_cast<double>(count) * (sizeof(double) + 2 * sizeof(float)));
  Tensor values = zeros({count}, NumberType::float64);
  double* next = values.data<double>();
  for (int l = 0; l < shape.layers + (zero_last_layer ? 0 : 1); ++l) {
    Random random(seed, 0x6d6c7000u + static_cast<std::uint64_t>(l));
    const double bound = 1.0 / std::sqrt(shape.fan_in(l));
    for (Index i = static_cast<Index>(shape.fan_out(l)) * (shape.fan_in(l) + 1); i > 0; --i)
      *next++ = random.uniform(-bound, bound);
  }
  state_ = std::make_unique<State>();
  state_->shape = shape;
  state_->parameters =
      values.to(double_precision ? NumberType::float64 : NumberType::float32).to_device(device);
  state_->gradient = zeros_like(state_->parameters);
  state_->layers = LayerViews(shape, state_->parameters);
  state_->trained = state_->layers;
}

Mlp::~Mlp() = default;
Mlp::Mlp(Mlp&&) noexcept = default;
Mlp& Mlp::operator=(Mlp&&) noexcept = default;

const MlpShape& Mlp::shape() const { return state_->shape; }
Tensor& Mlp::parameters() { return state_->parameters; }
const Tensor& Mlp::parameters() const { return state_->parameters; }
Tensor& Mlp::gradient() { return state_->gradient; }
Tensor Mlp::weight(int layer) const { return state_->layers.weights.at(static_cast<std::size_t>(layer)); }
Tensor Mlp::bias(int layer) const { return state_->layers.biases.at(static_cast<std::size_t>(layer)); }

void Mlp::round_products(bool rounded) {
  std::vector<Tensor>& copies = state_->trained.rounded;
  copies.clear();
  if (!rounded || state_->parameters.is_double()) return;
  for (const Tensor& weight : state_->layers.weights) {
    const bool large = weight.size(0) >= 64 && weight.size(1) >= 64;
    copies.push_back(large ? weight.to(NumberType::bfloat16) : Tensor());
  }
}

void Mlp::release_buffers() {
  state_->kept = {};
  state_->parts.clear();
  state_->result = Tensor();
  state_->fresh = false;
}

Tensor Mlp::forward(const Tensor& points, JetOrder order) {
  const ThreadScope scope;
  State& s = *state_;
  check_points(points, s.parameters);
  s.prepare(points, order);
  for (std::size_t l = 0; l < s.trained.rounded.size(); ++l)
    if (s.trained.rounded[l].defined()) s.trained.rounded[l].assign(s.layers.weights[l]);
  s.kept.for_each(s.kept.count(), [&](Block& block, Workspace& space, Index, bool) {
    sweep_forward(s.shape, s.trained, points, block, space, s.result);
  });
  s.fresh = true;
  return s.result;
}

void Mlp::pull_back(const Tensor& cotangents) {
  const ThreadScope scope;
  State& s = *state_;
  if (!s.fresh) throw std::logic_error("Mlp::pull_back needs a forward call of its own");
  require(same_sizes(cotangents, s.result) && cotangents.type() == s.result.type(), "cotangents",
          "another shape or dtype than the jets", "they must match");
  s.fresh = false;
  const Index groups = static_cast<Index>(s.parts.size());
  s.kept.for_each(groups, [&](Block& block, Workspace& space, Index group, bool first) {
    GradientPart& part = s.parts[static_cast<std::size_t>(group)];
    if (first && group > 0) part.flat.set_zero();
    sweep_back(s.shape, s.trained, cotangents, block, space, part.layers);
  });
  if (groups < 2) return;
  parallel_for(0, s.gradient.count(), 16384, [&](Index begin, Index end) {
    Tensor sum = s.gradient.slice(0, begin, end);
    for (std::size_t g = 1; g < s.parts.size(); ++g) sum.add(s.parts[g].flat.slice(0, begin, end));
  });
}

namespace {

/// Runs body(block, workspace) over all points with one block's memory a thread.
void stream_blocks(const MlpShape& shape, const Tensor& like, Index n, JetOrder order, bool keep,
                   const std::function<void(Block&, Workspace&)>& body) {
  Blocks passing;
  passing.blocks = split_points(n, order, !on_device_path(like));
  const int threads = sweep_threads(like, passing.blocks.size());
  std::vector<Block> memory(static_cast<std::size_t>(threads), largest_of(passing.blocks));
  for (Block& block : memory) {
    allocate(shape, like, keep, block);
    passing.workspaces.push_back(make_workspace(shape, like, block));
  }
  passing.for_each(passing.count(), [&](Block& block, Workspace& space, Index, bool) {
    const Block& own = memory[static_cast<std::size_t>(&space - passing.workspaces.data())];
    borrow(own, block);
    body(block, space);
    block = {};
  });
}

}  // namespace

Tensor Mlp::evaluate(const Tensor& points, JetOrder order) const {
  const ThreadScope scope;
  const State& s = *state_;
  check_points(points, s.parameters);
  Tensor result = empty({columns(order), points.size(0), s.shape.outputs}, s.parameters);
  stream_blocks(s.shape, s.parameters, points.size(0), order, order == JetOrder::second,
                [&](Block& block, Workspace& space) {
                  sweep_forward(s.shape, s.layers, points, block, space, result);
                });
  return result;
}

void Mlp::evaluate_with_gradient(const Tensor& points, Tensor& values, Tensor& gradients) const {
  const ThreadScope scope;
  const State& s = *state_;
  check_points(points, s.parameters);
  require(s.shape.outputs == 1, "network", std::to_string(s.shape.outputs) + " outputs", "expected one");
  values = empty({1, points.size(0), 1}, s.parameters);
  gradients = empty({points.size(0), 3}, s.parameters);
  stream_blocks(s.shape, s.parameters, points.size(0), JetOrder::value, true,
                [&](Block& block, Workspace& space) {
                  sweep_forward(s.shape, s.layers, points, block, space, values);
                  sweep_to_points(s.shape, s.layers, block, space, gradients);
                });
  values = values.view({-1});
}

}  // namespace arapfields
