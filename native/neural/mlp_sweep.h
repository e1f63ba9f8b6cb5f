// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "core/types.h"
#include "neural/mlp.h"
#include "tensors/tensor.h"

// The two sweeps through the layers, for one block of points.

namespace arapfields {

class Tensor;

// The steps of a layer that are not matrix products, on tensors: by the kernels of jet_kernels.h in main
// memory, by tensor operations on a device. `activations` and `jets` are (columns·n, width), `slope` is
// (n, width).

/// Softplus of this sharpness, and the number of columns: a value and its derivatives.
struct LayerStep {
  double sharpness = 30.0;
  int columns = 1;
};

/// Adds the bias and applies softplus. An undefined `slope` is not kept; one column does not use `jets`.
void activate_layer(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                    const Tensor& bias);
/// The cotangents of activate_layer's inputs. A defined `partial` is added to them.
void activate_layer_back(const LayerStep& step, Tensor& activations, const Tensor& slope,
                         const Tensor& partial, Tensor& cotangents, Tensor& bias_gradient);
/// One layer's part in the second derivatives (adjoint_kernels.h). `adjoints` (outputs·n, width), or
/// (outputs, width) for all points; `below` (outputs·n, width); `second` (n, 6, outputs) is added to.
void adjoint_layer(double sharpness, const Tensor& activations, const Tensor& slope, const Tensor& adjoints,
                   Tensor& below, Tensor& second);
void adjoint_layer_back(double sharpness, const Tensor& activations, const Tensor& slope,
                        const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                        Tensor& partial);
/// encoding (1 to 3, n, 6·octaves): values, and the first and second derivative of each entry.
void encode_points(const Tensor& points, double frequency, int octaves, Tensor& encoding);

/// Each layer's weight (fan_out, fan_in) and bias (fan_out) as views into one flat vector.
struct LayerViews {
  LayerViews() = default;
  LayerViews(const MlpShape& shape, const Tensor& flat);
  std::vector<Tensor> weights;
  std::vector<Tensor> biases;
  /// Copies of weights in bfloat16 for the products that shall be rounded; undefined, or none, elsewhere.
  std::vector<Tensor> rounded;
};

/// A range of points and what the forward sweep computes for it. activations[l] is (columns·count, width):
/// the pre-activations of layer l, then as in ActivationBlock; slope[l] (count, width) is φ', or undefined
/// where nothing is kept; encoding (1 to 3, count, 6·octaves). Second derivatives come from a sweep
/// downwards: adjoints[l] (outputs·count, width) are the outputs' derivatives by the activations of layer l,
/// but the last, whose row of the output layer's weight serves all points.
struct Block {
  Index begin = 0;
  Index count = 0;
  int columns = 1;
  bool second = false;
  Tensor encoding;
  std::vector<Tensor> activations;
  std::vector<Tensor> slope;
  std::vector<Tensor> adjoints;
};

/// What one thread needs besides: flat buffers for the largest block, the last three for second derivatives.
struct Workspace {
  Tensor jets;
  Tensor other;
  Tensor output;
  Tensor below;
  Tensor second;
  std::vector<Tensor> partial;
};

/// Where a group of blocks adds up its part of the parameter gradient.
struct GradientPart {
  Tensor flat;
  LayerViews layers;
};

/// The blocks of one size of call. Threads take groups of blocks as they come free, so that a slow or busy
/// core costs little; each group has its own order and its own sum, so that the result does not depend on who
/// did what, nor on how many did it.
struct Blocks {
  std::vector<Block> blocks;
  std::vector<Workspace> workspaces;  // one a thread

  /// `groups` runs of consecutive blocks: body(block, its thread's workspace, its group, whether it is the
  /// first).
  void for_each(Index groups, const std::function<void(Block&, Workspace&, Index group, bool first)>& body);
  Index count() const { return static_cast<Index>(blocks.size()); }
  /// Few enough groups that adding their sums up costs little beside the products.
  Index gradient_groups() const;
};

/// Ranges of about the best number of points for the order, some for each of a few threads where points are
/// few; large ones where a core's cache does not matter.
std::vector<Block> split_points(Index n, JetOrder order, bool in_cache);
/// Threads that sweeps of so many blocks of tensors like `like` are split over.
int sweep_threads(const Tensor& like, std::size_t blocks);

/// Gives a block its memory; for every layer whose activations `keep` selects. With one column the
/// encoding always has its first derivatives, for sweep_to_points().
void allocate(const MlpShape& shape, const Tensor& like, bool keep, Block& block);
/// Lends the memory of a block of at least as many points and the same order.
void borrow(const Block& memory, Block& block);
Workspace make_workspace(const MlpShape& shape, const Tensor& like, const Block& largest);

/// Jets of the block's points into result[:, begin:begin+count]. Second derivatives need a kept block.
void sweep_forward(const MlpShape& shape, const LayerViews& layers, const Tensor& points, Block& block,
                   Workspace& space, Tensor& result);
/// Adds to `gradient`; consumes the block.
void sweep_back(const MlpShape& shape, const LayerViews& layers, const Tensor& cotangents, Block& block,
                Workspace& space, LayerViews& gradient);
/// ∂(the one output)/∂point after a kept forward sweep with one column; consumes the block.
void sweep_to_points(const MlpShape& shape, const LayerViews& layers, Block& block, Workspace& space,
                     Tensor& gradients);

}  // namespace arapfields
