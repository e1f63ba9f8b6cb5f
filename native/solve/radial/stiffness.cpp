// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/stiffness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include "core/jets.h"
#include "core/parallel.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Tikhonov term, as a fraction of the mean diagonal: centers overlap so much that the matrix is singular up
/// to rounding.
constexpr double ridge = 1e-9;
/// Three linear combinations stand for the nine derivatives at a sample, for a third of the products.
constexpr int derivatives = 9, mixtures = 3;
/// Most samples of stance_rows().
constexpr Index stance_samples = 1000;
/// The sum is split into so many parts, independent of the number of threads, so that its rounding is too.
/// Progress is reported after each of `slices` slices of all parts.
constexpr Index parts = 4, slices = 8;
/// Points of a block, and blocks per product: neighbours, which have nearly the same active centers.
constexpr Index block_size = 16, blocks_at_once = 3;

/// An orthogonal matrix (of a discrete cosine transform) times √3: over triples of points, which take three
/// rows each, the mean of the combinations' squares is that of all nine derivatives.
RowMatrix<double> mixing_matrix() {
  RowMatrix<double> result(derivatives, derivatives);
  for (int i = 0; i < derivatives; ++i)
    for (int c = 0; c < derivatives; ++c)
      result(i, c) = std::sqrt(i == 0 ? 1.0 : 2.0) / std::sqrt(static_cast<double>(mixtures)) *
                     std::cos(std::numbers::pi * (2 * c + 1) * i / (2.0 * derivatives));
  return result;
}

/// Assembles the weighted sum over points of the products of basis functions' derivatives.
class StiffnessAssembler {
 public:
  /// `free` (derivatives + 1, points): jets of the free weight, a factor on all basis functions; or empty.
  StiffnessAssembler(const RadialEvaluator<double>& sites, Vector roots, Vector weight_roots, Vector free)
      : sites_(sites),
        roots_(std::move(roots)),
        weight_roots_(std::move(weight_roots)),
        free_(std::move(free)),
        mixing_(mixing_matrix()) {}

  /// Adds the products at the points of blocks first to last−1 to the lower triangle of `sum`, whose rows and
  /// columns are the centers, the constant and three linear functions.
  void add(Index first, Index last, RowMatrix<double>& sum);

 private:
  void gather_active(Index first, Index last);
  void add_rows(Index b, Index column);
  void mix(Index b);
  void multiply(Index b, double* jets) const;

  const RadialEvaluator<double>& sites_;
  Vector roots_, weight_roots_;  // √λ and √w of the points; the latter may be empty
  Vector free_;
  RowMatrix<double> mixing_;
  std::vector<std::int32_t> active_, both_;  // centers whose support contains a point, ascending
  std::vector<double> jets_;
  std::array<double, mixtures * derivatives * block_size> mix_{};  // (mixture, derivative, point)
  RowMatrix<double> rows_, products_;
};

void StiffnessAssembler::gather_active(Index first, Index last) {
  active_.clear();
  for (Index b = first; b < last; ++b) {
    const RadialBlock<double> block = sites_.block(b);
    both_.clear();
    std::set_union(active_.begin(), active_.end(), block.active, block.active + block.active_count,
                   std::back_inserter(both_));
    active_.swap(both_);
  }
}

/// Fills mix_: the factor of each derivative at each point of a block in each combination. Three consecutive
/// points take different rows of the mixing matrix.
void StiffnessAssembler::mix(Index b) {
  const Index points = std::min(block_size, sites_.size() - block_size * b);
  mix_.fill(0.0);
  for (int m = 0; m < mixtures; ++m)
    for (int c = 0; c < derivatives; ++c)
      for (Index p = 0; p < points; ++p) {
        const double shared = c < 6 ? 1.0 : std::numbers::sqrt2;  // mixed derivatives occur twice in ‖D‖²
        mix_[static_cast<std::size_t>((m * derivatives + c) * block_size + p)] =
            mixing_(mixtures * (p % 3) + m, c) * (c < 3 ? 1.0 : shared * roots_[block_size * b + p]) *
            (weight_roots_.size() > 0 ? weight_roots_[block_size * b + p] : 1.0);
      }
}

/// Multiplies the jets (derivatives + 1, block_size) of a basis function by the free weight, if there is one.
void StiffnessAssembler::multiply(Index b, double* jets) const {
  if (free_.size() == 0) return;
  const Index n = sites_.size(), points = std::min(block_size, n - block_size * b);
  for (Index i = 0; i < points; ++i) {
    const auto a = [&](int c) { return free_[c * n + block_size * b + i]; };
    multiply_jet(a, [&](int c) -> double& { return jets[c * block_size + i]; });
  }
}

void StiffnessAssembler::add_rows(Index b, Index column) {
  const RadialBlock<double> block = sites_.block(b);
  jets_.resize(static_cast<std::size_t>(block.active_count * (derivatives + 1) * block_size));
  ARAPFIELDS_DISPATCH(radial_rows(block, derivatives + 1, jets_.data()));
  mix(b);
  const auto add_mixed = [&](const double* jets, Index row) {
    const double* factors = mix_.data();
    for (int m = 0; m < mixtures; ++m) {
      double* to = &rows_(row, column + m * block_size);
      for (int c = 1; c <= derivatives; ++c, factors += block_size)
        for (Index p = 0; p < block_size; ++p) to[p] += factors[p] * jets[c * block_size + p];
    }
  };
  auto place = active_.begin();
  for (Index a = 0; a < block.active_count; ++a) {
    place = std::find(place, active_.end(), block.active[a]);
    double* jets = &jets_[static_cast<std::size_t>(a * (derivatives + 1) * block_size)];
    multiply(b, jets);
    add_mixed(jets, place - active_.begin());
  }
  for (int k = 0; k < 4; ++k) {  // the constant, x, y, z
    std::array<double, (derivatives + 1) * block_size> jets{};
    for (Index p = 0; p < block_size; ++p) {
      jets[static_cast<std::size_t>(p)] = k == 0 ? 1.0 : block.points[(k - 1) * block_size + p];
      if (k > 0) jets[static_cast<std::size_t>(k * block_size + p)] = 1.0;
    }
    multiply(b, jets.data());
    add_mixed(jets.data(), rows_.rows() - 4 + k);
  }
}

void StiffnessAssembler::add(Index first, Index last, RowMatrix<double>& sum) {
  gather_active(first, last);
  const Index count = static_cast<Index>(active_.size()), size = count + 4, centers = sum.rows() - 4;
  rows_.setZero(size, mixtures * block_size * (last - first));
  for (Index b = first; b < last; ++b) add_rows(b, mixtures * block_size * (b - first));
  products_.resize(size, size);
  lower_gram<double>(Transpose::no, rows_, 0.0, products_);
  const auto place = [&](Index i) {
    return i < count ? Index{active_[static_cast<std::size_t>(i)]} : centers + i - count;
  };
  for (Index i = 0; i < size; ++i) {
    double* to = sum.row(place(i)).data();
    for (Index j = 0; j <= i; ++j) to[place(j)] += products_(i, j);
  }
}

}  // namespace

RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending,
                                   const Vector& weights, const Progress& progress,
                                   const HandleBlend* blend) {
  const RadialEvaluator<double> sites(basis, samples);
  Vector free(blend != nullptr ? (derivatives + 1) * samples.rows() : 0);
  if (blend != nullptr) blend->free_weight(samples, JetOrder::second, free.data());
  std::vector<RowMatrix<double>> sums(parts, RowMatrix<double>::Zero(basis.size(), basis.size()));
  std::vector<StiffnessAssembler> assemblers(
      parts, StiffnessAssembler(sites, bending.cwiseSqrt(), weights.cwiseSqrt(), free));
  const Index groups = (sites.blocks() + blocks_at_once - 1) / blocks_at_once;
  for (Index slice = 0; slice < slices; ++slice) {
    parallel_jobs(parts, [&](Index part) {
      const Index piece = part * slices + slice, pieces = parts * slices;
      for (Index group = piece * groups / pieces; group < (piece + 1) * groups / pieces; ++group)
        assemblers[static_cast<std::size_t>(part)].add(group * blocks_at_once,
                                                       std::min(sites.blocks(), (group + 1) * blocks_at_once),
                                                       sums[static_cast<std::size_t>(part)]);
    });
    progress.report(static_cast<double>(slice + 1) / slices, "stiffness");
  }
  for (std::size_t part = 1; part < sums.size(); ++part) sums[0] += sums[part];
  return sums[0] / static_cast<double>(samples.rows());
}

std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance) {
  const Index taken = std::min<Index>(samples.rows(), stance_samples);
  Points some(taken, 3);
  Vector weights(taken);
  for (Index i = 0; i < taken; ++i) {
    const Index pick = i * samples.rows() / taken;
    some.row(i) = samples.row(pick);
    weights[i] = stance.scale * (1.0 + stance.ground[pick] / 3.0) / static_cast<double>(taken);
  }
  RowMatrix<double> rows = radial_rows(basis, some, JetOrder::value);
  rows.rowwise() -= (weights.transpose() * rows / weights.sum()).eval();
  return {std::move(rows), std::move(weights)};
}

RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights) {
  const RowMatrix<double> weighted = weights.cwiseSqrt().asDiagonal() * values;
  lower_gram<double>(Transpose::yes, weighted, 1.0, stiffness);
  stiffness.diagonal().array() += ridge * stiffness.diagonal().mean();
  return lower_inverse<double>(cholesky<double>(stiffness));
}

void StiffnessTerms::update(const BoundHandles& handles, const Progress& progress) {
  const Vector weights_before = weights_, bending_before = bending_;
  add_samples(handles);
  const auto is_same = [](const Vector& a, const Vector& b) { return a.size() == b.size() && a == b; };
  if (revision_ > 0 && is_same(weights_, weights_before) && is_same(bending_, bending_before)) return;
  matrix_ = stiffness_matrix(problem_.basis, problem_.energy_points, bending_, weights_, progress,
                             problem_.blend.get());
  if (problem_.mirror) problem_.mirror->symmetrise_matrix(matrix_);
  ++revision_;
}

void StiffnessTerms::add_samples(const BoundHandles& handles) {
  const auto& rows = problem_.energy_samples;
  bending_ = own_bending_.get({problem_.energy_revision},
                              [&] { return problem_.stiffness.bending(problem_.energy_points); });
  if (problem_.samples.bend_weights.size() > 0)
    bending_.array() *= entries_of(problem_.samples.bend_weights, rows).array();
  const Vector all = energy_weights(problem_.samples, handles);
  weights_ = all.size() > 0 ? entries_of(all, rows) : Vector();
  if (const Vector areas = problem_.energy_areas(); areas.size() > 0)
    weights_ = weights_.size() > 0 ? Vector(weights_.cwiseProduct(areas)) : areas;
}

}  // namespace arapfields
