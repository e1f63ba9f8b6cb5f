// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/mlp_sweep.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <ATen/core/LegacyTypeDispatch.h>

#include <algorithm>
#include <atomic>

#include "core/parallel.h"
#include "neural/jet_layer.h"

namespace arapfields {
namespace {

std::size_t at_(int i) { return static_cast<std::size_t>(i); }

/// The first rows·cols numbers of a flat buffer as a matrix.
at::Tensor matrix(const at::Tensor& flat, Index rows, Index cols) {
  return flat.narrow(0, 0, rows * cols).view({rows, cols});
}

/// c (+)= a b, into c's own memory.
void product(at::Tensor c, const at::Tensor& a, const at::Tensor& b) { at::mm_out(c, a, b); }
void add_product(at::Tensor c, const at::Tensor& a, const at::Tensor& b) { at::addmm_out(c, c, a, b); }

int derivatives_of(const Block& block) { return block.columns == 10 ? 3 : block.columns == 4 ? 2 : 1; }

/// Pre-activations of the first layer: each coordinate's derivatives meet their own part of the weight alone.
void encode_layer(const MlpShape& shape, const at::Tensor& weight, const at::Tensor& points, Block& block) {
  encode_points(points.narrow(0, block.begin, block.count), shape.frequency, shape.octaves, block.encoding);
  const Index m = block.count, part = 2 * shape.octaves;
  at::Tensor& z = block.planes[0];
  product(z.narrow(0, 0, m), block.encoding[0], weight.t());
  for (int derivative = 1; derivative < derivatives_of(block); ++derivative)
    for (int i = 0; i < 3; ++i)
      product(z.narrow(0, (3 * derivative - 2 + i) * m, m),
              block.encoding[derivative].narrow(1, i * part, part), weight.narrow(1, i * part, part).t());
}

void encode_layer_back(const MlpShape& shape, const at::Tensor& cotangents, Block& block,
                       at::Tensor gradient) {
  const Index m = block.count, part = 2 * shape.octaves;
  add_product(gradient, cotangents.narrow(0, 0, m).t(), block.encoding[0]);
  for (int derivative = 1; derivative < derivatives_of(block); ++derivative)
    for (int i = 0; i < 3; ++i)
      add_product(gradient.narrow(1, i * part, part),
                  cotangents.narrow(0, (3 * derivative - 2 + i) * m, m).t(),
                  block.encoding[derivative].narrow(1, i * part, part));
}

}  // namespace

LayerViews::LayerViews(const MlpShape& shape, const at::Tensor& flat) {
  Index begin = 0;
  for (int l = 0; l <= shape.layers; ++l) {
    const Index out = shape.fan_out(l), in = shape.fan_in(l);
    weights.push_back(flat.narrow(0, begin, out * in).view({out, in}));
    biases.push_back(flat.narrow(0, begin + out * in, out));
    begin += out * (in + 1);
  }
}

int sweep_threads(const at::Tensor& like) {
  return like.is_cpu() && !at::in_parallel_region() ? thread_count() : 1;
}

std::vector<Block> split_points(Index n, int columns, int threads, bool on_cpu) {
  // Blocks whose planes fit a core's second-level cache; elsewhere one block that memory bounds.
  const Index best = on_cpu ? (columns == 1 ? 512 : columns == 4 ? 128 : 64) : (Index(1) << 19) / columns;
  Index count = (n + best - 1) / best;
  count = std::min((count + threads - 1) / threads * threads, std::max<Index>(n, 1));
  std::vector<Block> blocks(static_cast<std::size_t>(count));
  for (Index b = 0; b < count; ++b) {
    Block& block = blocks[static_cast<std::size_t>(b)];
    block.begin = b * n / count;
    block.count = (b + 1) * n / count - block.begin;
    block.columns = columns;
  }
  return blocks;
}

void allocate(const MlpShape& shape, const at::Tensor& like, bool keep, Block& block) {
  const Index m = block.count, stored = block.columns == 10 ? 3 : 2;
  block.encoding = at::empty({stored, m, shape.encoded()}, like.options());
  block.planes.clear(), block.slope.clear();
  // Where nothing is kept, two buffers take turns.
  for (int l = 0; l < shape.layers; ++l) {
    const bool own = keep || l < 2;
    block.planes.push_back(own ? at::empty({block.columns * m, shape.width}, like.options())
                               : block.planes[at_(l - 2)]);
    block.slope.push_back(keep ? at::empty({m, shape.width}, like.options()) : at::Tensor());
  }
}

void borrow(const Block& memory, Block& block) {
  const Index m = block.count;
  block.encoding = memory.encoding.view({-1})
                       .narrow(0, 0, memory.encoding.size(0) * m * memory.encoding.size(2))
                       .view({memory.encoding.size(0), m, memory.encoding.size(2)});
  block.planes.clear(), block.slope.clear();
  for (const at::Tensor& planes : memory.planes)
    block.planes.push_back(planes.narrow(0, 0, block.columns * m));
  for (const at::Tensor& slope : memory.slope)
    block.slope.push_back(slope.defined() ? slope.narrow(0, 0, m) : slope);
}

Workspace make_workspace(const MlpShape& shape, const at::Tensor& like, Index points, int columns) {
  Workspace space;
  const Index size = columns * points * shape.width;
  space.jets = at::empty({size}, like.options());
  space.other = at::empty({size}, like.options());
  space.output = at::empty({columns * points * shape.outputs}, like.options());
  return space;
}

Index Blocks::gradient_groups() const {
  const Index threads = static_cast<Index>(workspaces.size());
  return std::min(count(), std::max(threads, std::min<Index>(4 * threads, count() / 4)));
}

void Blocks::for_each(Index groups, const std::function<void(Block&, Workspace&, Index, bool)>& body) {
  std::atomic<Index> next{0};
  parallel_for(0, static_cast<Index>(workspaces.size()), 1, [&](Index first, Index last) {
    const at::AutoDispatchBelowADInplaceOrView quick;  // plain kernels, no bookkeeping
    for (Index t = first; t < last; ++t)
      for (Index g = next++; g < groups; g = next++) {
        const Index begin = g * count() / groups, end = (g + 1) * count() / groups;
        for (Index b = begin; b < end; ++b)
          body(blocks[static_cast<std::size_t>(b)], workspaces[static_cast<std::size_t>(t)], g, b == begin);
      }
  });
}

void sweep_forward(const MlpShape& shape, const LayerViews& layers, const at::Tensor& points, Block& block,
                   Workspace& space, at::Tensor& result) {
  if (block.count == 0) return;
  const Index rows = block.columns * block.count;
  at::Tensor jets = matrix(space.jets, rows, shape.width);
  for (int l = 0; l < shape.layers; ++l) {
    at::Tensor& planes = block.planes[at_(l)];
    const at::Tensor& below = block.columns == 1 && l > 0 ? block.planes[at_(l - 1)] : jets;
    if (l == 0)
      encode_layer(shape, layers.weights[0], points, block);
    else
      product(planes, below, layers.weights[at_(l)].t());
    activate_layer({shape.sharpness, block.columns, l > 0}, planes, block.slope[at_(l)], jets,
                   layers.biases[at_(l)]);
  }
  const at::Tensor& top = block.columns == 1 ? block.planes.back() : jets;
  at::Tensor output = matrix(space.output, rows, shape.outputs);
  product(output, top, layers.weights.back().t());
  output.narrow(0, 0, block.count).add_(layers.biases.back());
  result.narrow(1, block.begin, block.count).copy_(output.view({block.columns, block.count, shape.outputs}));
}

void sweep_back(const MlpShape& shape, const LayerViews& layers, const at::Tensor& cotangents, Block& block,
                Workspace& space, LayerViews& gradient) {
  if (block.count == 0) return;
  const Index rows = block.columns * block.count;
  at::Tensor upper = matrix(space.output, rows, shape.outputs);
  upper.view({block.columns, block.count, shape.outputs})
      .copy_(cotangents.narrow(1, block.begin, block.count));
  gradient.biases.back().add_(upper.narrow(0, 0, block.count).sum(0));
  at::Tensor here = matrix(space.jets, rows, shape.width), spare = matrix(space.other, rows, shape.width);
  for (int l = shape.layers - 1; l >= 0; --l) {
    at::Tensor& planes = block.planes[at_(l)];
    product(here, upper, layers.weights[at_(l + 1)]);
    activate_layer_back({shape.sharpness, block.columns, l > 0}, planes, block.slope[at_(l)], here,
                        gradient.biases[at_(l)]);
    add_product(gradient.weights[at_(l + 1)], upper.t(), planes);
    upper = here;
    std::swap(here, spare);
  }
  encode_layer_back(shape, upper, block, gradient.weights[0]);
}

void sweep_to_points(const MlpShape& shape, const LayerViews& layers, Block& block, Workspace& space,
                     at::Tensor& gradients) {
  if (block.count == 0) return;
  const Index m = block.count;
  at::Tensor here = matrix(space.jets, m, shape.width), spare = matrix(space.other, m, shape.width);
  at::mul_out(here, block.slope.back(), layers.weights.back());
  for (int l = shape.layers - 2; l >= 0; --l) {
    product(spare, here, layers.weights[at_(l + 1)]);
    spare.mul_(block.slope[at_(l)]);
    std::swap(here, spare);
  }
  const at::Tensor encoded = at::mm(here, layers.weights[0]).mul_(block.encoding[1]);
  gradients.narrow(0, block.begin, m).copy_(encoded.view({m, 3, 2 * shape.octaves}).sum(2));
}

}  // namespace arapfields
