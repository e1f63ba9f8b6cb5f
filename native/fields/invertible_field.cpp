// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/invertible_field.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <stdexcept>

#include "core/errors.h"
#include "core/jets2d.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "neural/coupling_sweep.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// Points of a block, and the largest number of groups of blocks, each with a gradient of its own. Both are
/// constant, so that results do not depend on the number of threads.
constexpr Index block_points = 48, value_block_points = 256, most_groups = 8;

struct Range {
  Index begin, count;
};

std::vector<Range> ranges_of(Index n, JetOrder order) {
  const Index most = order == JetOrder::value ? value_block_points : block_points;
  const Index blocks = (n + most - 1) / most;
  std::vector<Range> ranges;
  for (Index b = 0; b < blocks; ++b) {
    const Index begin = b * n / blocks;
    ranges.push_back({begin, (b + 1) * n / blocks - begin});
  }
  return ranges;
}

/// body(range's number, group) for all ranges, groups of consecutive ones in parallel.
void for_groups(Index ranges, const std::function<void(Index, Index)>& body) {
  const Index groups = std::min(ranges, most_groups);
  parallel_jobs(groups, [&](Index g) {
    for (Index r = g * ranges / groups; r < (g + 1) * ranges / groups; ++r) body(r, g);
  });
}

/// The same for independent ranges.
void for_each_range(const std::vector<Range>& ranges, const std::function<void(const Range&)>& body) {
  parallel_jobs(static_cast<Index>(ranges.size()), [&](Index r) { body(ranges[r]); });
}

}  // namespace

struct InvertibleField::State {
  /// Activations of a forward call, for the pull-back.
  struct Pass {
    Index count;
    JetOrder order;
    std::vector<Range> ranges;
    std::vector<std::vector<CouplingMemory>> kept;
  };
  CouplingShape shape;
  Tensor parameters, gradient;
  CouplingViews views;
  std::deque<Pass> passes;  // buffers, the last used first; an iteration of a solve has two batch sizes
  bool fresh = false;
  // Gradients of the groups but the first.
  std::vector<Tensor> parts;
  std::vector<CouplingViews> part_views;

  Pass& prepare(Index count, JetOrder order) {
    constexpr std::size_t most_passes = 2;
    for (std::size_t i = 0; i < passes.size(); ++i)
      if (passes[i].count == count && passes[i].order == order) {
        std::swap(passes[i], passes.front());
        return passes.front();
      }
    const double numbers = static_cast<double>(count) * std::min(columns(order), columns2) * shape.couplings *
                           (2.0 * shape.layers * shape.width + shape.fan_in(0));
    if (passes.size() == most_passes) passes.pop_back();
    require_memory("batch", numbers * (parameters.is_double() ? sizeof(double) : sizeof(float)));
    Pass& pass = passes.emplace_front(Pass{count, order, ranges_of(count, order), {}});
    for (const Range& range : pass.ranges)
      pass.kept.push_back(coupling_memory(shape, parameters, range.count, columns(order), true));
    return pass;
  }
};

InvertibleField::InvertibleField(const CouplingShape& shape, std::uint64_t seed, bool double_precision)
    : state_(std::make_unique<State>()) {
  shape.validate();
  require(shape.couplings > 0, "couplings", std::to_string(shape.couplings), "at least one is needed");
  const ThreadScope scope;
  require_memory("width", static_cast<double>(shape.size()) * (sizeof(double) + 2 * sizeof(float)));
  Tensor values = zeros({shape.size()}, NumberType::float64);
  double* next = values.data<double>();
  for (int i = 0; i < shape.couplings; ++i)
    for (int l = 0; l <= shape.layers; ++l) {
      const Index numbers = static_cast<Index>(shape.fan_out(l)) * (shape.fan_in(l) + 1);
      Random random(seed, 0x636f7570u + static_cast<std::uint64_t>(i * (shape.layers + 1) + l));
      const double bound = l < shape.layers ? 1.0 / std::sqrt(shape.fan_in(l)) : 0.0;
      for (Index k = 0; k < numbers; ++k) *next++ = random.uniform(-bound, bound);
    }
  State& s = *state_;
  s.shape = shape;
  s.parameters = values.to(double_precision ? NumberType::float64 : NumberType::float32);
  s.gradient = zeros_like(s.parameters);
  s.views = CouplingViews(shape, s.parameters);
}

InvertibleField::~InvertibleField() = default;

const CouplingShape& InvertibleField::shape() const { return state_->shape; }
Tensor& InvertibleField::parameters() { return state_->parameters; }
Tensor& InvertibleField::gradient() { return state_->gradient; }

std::vector<MatrixPlace> InvertibleField::matrices() const {
  const CouplingShape& shape = state_->shape;
  std::vector<MatrixPlace> places;
  Index begin = 0;
  for (int i = 0; i < shape.couplings; ++i)
    for (int l = 0; l <= shape.layers; ++l) {
      const Index out = shape.fan_out(l), in = shape.fan_in(l);
      if (l < shape.layers) places.push_back({begin, out, in});
      begin += out * (in + 1);
    }
  return places;
}

void InvertibleField::evaluate(PointsIn points, JetView<double> out) const {
  const ThreadScope scope;
  require(out.count == points.rows(), "out", std::to_string(out.count) + " jets", "one a point is needed");
  const State& s = *state_;
  Tensor result = tensor_view(out);
  result[0].assign(tensor_view(points));
  Tensor values = result[0];
  const Tensor x = out.order == JetOrder::value ? Tensor() : values.clone().to(s.parameters.type());
  for_each_range(ranges_of(points.rows(), out.order), [&](const Range& range) {
    move_points(s.shape, s.views, values.narrow(0, range.begin, range.count), false);
    if (out.order == JetOrder::value) return;
    const int count = columns(out.order);
    std::vector<CouplingMemory> memory = coupling_memory(s.shape, s.parameters, range.count, count, false);
    const Tensor jets = couple(s.shape, s.views, x.narrow(0, range.begin, range.count), out.order, memory);
    result.narrow(0, 1, count - 1).narrow(1, range.begin, range.count).assign(jets.narrow(0, 1, count - 1));
  });
}

Points InvertibleField::preimages(PointsIn points) const {
  const ThreadScope scope;
  const State& s = *state_;
  Points result = points;
  const Tensor x = tensor_view(result);
  for_each_range(ranges_of(points.rows(), JetOrder::value), [&](const Range& range) {
    move_points(s.shape, s.views, x.narrow(0, range.begin, range.count), true);
  });
  return result;
}

Tensor InvertibleField::forward(const Tensor& points, JetOrder order) {
  const ThreadScope scope;
  State& s = *state_;
  require(
      points.dims() == 2 && points.size(1) == 3 && points.on_host() && points.type() == s.parameters.type(),
      "points", "another shape, dtype or device", "expected an (n,3) tensor like the parameters");
  State::Pass& pass = s.prepare(points.size(0), order);
  Tensor result = empty({columns(order), points.size(0), 3}, s.parameters);
  for_groups(static_cast<Index>(pass.ranges.size()), [&](Index r, Index) {
    const Range& range = pass.ranges[r];
    result.narrow(1, range.begin, range.count)
        .assign(couple(s.shape, s.views, points.narrow(0, range.begin, range.count), order, pass.kept[r]));
  });
  s.fresh = true;
  return result;
}

Tensor InvertibleField::forward_at(PointsIn points, JetOrder order) {
  const ThreadScope scope;
  return forward(tensor_like(points, state_->parameters), order);
}

void InvertibleField::pull_back(const Tensor& cotangents) {
  const ThreadScope scope;
  State& s = *state_;
  if (!s.fresh) throw std::logic_error("InvertibleField::pull_back needs a forward call of its own");
  State::Pass& pass = s.passes.front();
  require(cotangents.dims() == 3 && cotangents.size(0) == columns(pass.order) &&
              cotangents.size(1) == pass.count && cotangents.type() == s.parameters.type(),
          "cotangents", "another shape or dtype than the jets", "they must match");
  s.fresh = false;
  const auto ranges = static_cast<Index>(pass.ranges.size());
  const Index groups = std::min(ranges, most_groups);
  while (static_cast<Index>(s.parts.size()) < groups) {
    s.parts.push_back(s.parts.empty() ? s.gradient : empty_like(s.gradient));
    s.part_views.emplace_back(s.shape, s.parts.back());
  }
  for (Index g = 1; g < groups; ++g) s.parts[g].set_zero();
  for_groups(ranges, [&](Index r, Index g) {
    const Range& range = pass.ranges[r];
    couple_back(s.shape, s.views, cotangents.narrow(1, range.begin, range.count), pass.kept[r],
                s.part_views[g]);
  });
  for (Index g = 1; g < groups; ++g) s.gradient.add(s.parts[g]);
}

void InvertibleField::translate(const Vec3& offset) {
  state_->views.offset.add(tensor_like(offset, state_->parameters));
}

VectorF InvertibleField::weights() const {
  const ThreadScope scope;
  return floats_of(state_->parameters);
}

void InvertibleField::set_weights(const VectorF& weights) {
  const ThreadScope scope;
  Tensor& own = state_->parameters;
  require(weights.size() == own.count(), "weights", std::to_string(weights.size()) + " numbers",
          "this field has " + std::to_string(own.count()));
  own.assign(tensor_view(weights));
}

InvertibleProbe probe_invertible(const CouplingShape& shape, const Vector& parameters, PointsIn points,
                                 JetOrder order, const Vector& cotangents) {
  const ThreadScope scope;
  InvertibleField field(shape, 0, true);
  require(parameters.size() == field.parameters().count(), "parameters",
          std::to_string(parameters.size()) + " numbers",
          std::to_string(field.parameters().count()) + " are needed");
  field.parameters().assign(tensor_view(parameters));
  const Tensor jets = field.forward_at(points, order);
  InvertibleProbe result;
  result.jets = vector_of(jets);
  result.preimages = field.preimages(points_of(jets[0]));
  if (cotangents.size() == 0) return result;
  require(cotangents.size() == result.jets.size(), "cotangents",
          std::to_string(cotangents.size()) + " numbers", "as many as the jets' are needed");
  field.pull_back(tensor_view(cotangents).view_like(jets).clone());
  result.gradient = vector_of(field.gradient());
  return result;
}

}  // namespace arapfields
