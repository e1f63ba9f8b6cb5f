// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/surface_laplacian.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// Groups that a factor solves for.
constexpr Index coarsest_size = 1500;
/// Weight that binds a node to its place weakly, relative to its diagonal.
constexpr double binding = 1e-7;
/// Iterations on the nodes, of which most systems need two or three, and on groups in each cycle.
constexpr int most_iterations = 8, iterations_on_groups = 2;
/// Residual on groups, relative to that at the start, which is enough in a cycle.
constexpr double tolerance_on_groups = 0.2;
/// Weight of an edge relative to the root of its nodes' diagonals, from which on it joins them in one group.
constexpr double joining = 0.08;
/// Factor of a smoothing step.
constexpr double damping = 0.7;
constexpr Index laplacian_grain = 4096;

/// Σ of body(begin, end) over chunks of nodes, in an order that follows from their number alone.
template <class Body>
double sum_over(Index nodes, const Body& body) {
  Vector parts = Vector::Zero((nodes + laplacian_grain - 1) / laplacian_grain);
  parallel_for(0, nodes, laplacian_grain,
               [&](Index begin, Index end) { parts[begin / laplacian_grain] = body(begin, end); });
  return parts.sum();
}

}  // namespace

/// Each free node and its free neighbours by strong edges, where none of them is in a group yet; what is left
/// joins the group of its strongest neighbour.
std::vector<std::int32_t> SurfaceLaplacian::groups_of(const Matrix& matrix, Index& count) {
  std::vector<std::int32_t> group(matrix.size(), -1);
  count = 0;
  const auto each = [&](Index i, auto&& visit) {
    for (std::int32_t at = matrix.first[i]; at < matrix.first[i + 1]; ++at)
      if (!matrix.held[matrix.neighbour[at]]) visit(matrix.neighbour[at], matrix.weight[at]);
  };
  for (Index i = 0; i < matrix.size(); ++i) {
    const auto each_joined = [&](auto&& visit) {
      each(i, [&](Index j, double weight) {
        if (weight > joining * std::sqrt(matrix.diagonal[i] * matrix.diagonal[j])) visit(j);
      });
    };
    bool open = !matrix.held[i] && group[i] < 0;
    if (open) each_joined([&](Index j) { open = open && group[j] < 0; });
    if (!open) continue;
    group[i] = static_cast<std::int32_t>(count++);
    each_joined([&](Index j) { group[j] = group[i]; });
  }
  std::vector<std::int32_t> result = group;
  for (Index i = 0; i < matrix.size(); ++i) {
    if (matrix.held[i] || group[i] >= 0) continue;
    double strongest = -1.0;
    each(i, [&](Index j, double weight) {
      if (group[j] >= 0 && weight > strongest) {
        strongest = weight;
        result[i] = group[j];
      }
    });
  }
  return result;
}

/// The matrix of groups: entries are sums over their members.
SurfaceLaplacian::Matrix SurfaceLaplacian::grouped(const Level& level, Index count) {
  const Matrix& matrix = level.matrix;
  Matrix result;
  result.diagonal.setZero(count);
  result.held.assign(count, 0);
  std::vector<std::pair<std::int32_t, double>> row;
  for (Index g = 0; g < count; ++g) {
    row.clear();
    double diagonal = 0.0;
    for (std::int32_t at = level.first[g]; at < level.first[g + 1]; ++at) {
      const std::int32_t i = level.members[at];
      diagonal += matrix.diagonal[i];
      for (std::int32_t e = matrix.first[i]; e < matrix.first[i + 1]; ++e) {
        const std::int32_t other = level.group_of[matrix.neighbour[e]];
        if (other == g)
          diagonal -= matrix.weight[e];
        else if (other >= 0)
          row.emplace_back(other, matrix.weight[e]);
      }
    }
    result.diagonal[g] = diagonal;
    std::sort(row.begin(), row.end());
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (k > 0 && row[k].first == row[k - 1].first) {
        result.weight.back() += row[k].second;
        continue;
      }
      result.neighbour.push_back(row[k].first);
      result.weight.push_back(row[k].second);
    }
    result.first.push_back(static_cast<std::int32_t>(result.neighbour.size()));
  }
  result.inverse_diagonal = result.diagonal.cwiseInverse();
  return result;
}

SurfaceLaplacian::SurfaceLaplacian(const WeldedSurface& surface, const Vector& factors,
                                   const std::vector<char>& held, const Progress& progress,
                                   const Vector& bound)
    : held_(held) {
  Matrix matrix;
  matrix.first = surface.first_neighbour();
  matrix.neighbour = surface.neighbours();
  matrix.weight = surface.edge_weights(factors);
  matrix.held = held;
  Vector diagonal = Vector::Zero(surface.nodes());
  for (Index i = 0; i < surface.nodes(); ++i)
    for (std::int32_t at = matrix.first[i]; at < matrix.first[i + 1]; ++at) diagonal[i] += matrix.weight[at];
  bound_ = bound.size() > 0 ? bound : Vector(binding * diagonal);
  matrix.diagonal = diagonal + bound_;
  matrix.inverse_diagonal = matrix.diagonal.cwiseInverse();

  for (bool fewer = true; matrix.size() > coarsest_size && fewer;) {
    progress.check();
    Level level;
    level.matrix = std::move(matrix);
    Index count = 0;
    level.group_of = groups_of(level.matrix, count);
    level.first.assign(count + 1, 0);
    for (const std::int32_t g : level.group_of)
      if (g >= 0) ++level.first[g + 1];
    for (Index g = 0; g < count; ++g) level.first[g + 1] += level.first[g];
    level.members.resize(level.first.back());
    std::vector<std::int32_t> free(level.first.begin(), level.first.end() - 1);
    for (Index i = 0; i < level.matrix.size(); ++i)
      if (level.group_of[i] >= 0) level.members[free[level.group_of[i]]++] = static_cast<std::int32_t>(i);
    matrix = grouped(level, count);
    fewer = count < level.matrix.size();  // not where each piece is one group
    levels_.push_back(std::move(level));
  }

  std::vector<Eigen::Triplet<double>> entries;
  for (Index i = 0; i < matrix.size(); ++i) {
    entries.emplace_back(i, i, matrix.diagonal[i]);
    if (matrix.held[i]) continue;
    for (std::int32_t at = matrix.first[i]; at < matrix.first[i + 1]; ++at)
      if (matrix.neighbour[at] < i && !matrix.held[matrix.neighbour[at]])
        entries.emplace_back(i, matrix.neighbour[at], -matrix.weight[at]);
  }
  Eigen::SparseMatrix<double> factored(matrix.size(), matrix.size());
  factored.setFromTriplets(entries.begin(), entries.end());
  progress.check();
  if (matrix.size() > 0) coarsest_.compute(factored);
  levels_.emplace_back().matrix = std::move(matrix);
}

double SurfaceLaplacian::multiply(std::size_t l, const Points& x, Points& product) const {
  product.resize(x.rows(), 3);
  const Matrix& matrix = levels_[l].matrix;
  return sum_over(x.rows(), [&](Index begin, Index end) {
    double inner = 0.0;
    for (Index i = begin; i < end; ++i) {
      if (is_still(l, i)) {
        product.row(i).setZero();
        continue;
      }
      product.row(i) = matrix.times(x, i);
      inner += product.row(i).dot(x.row(i));
    }
    return inner;
  });
}

/// A smoothing step, what the groups give, and another smoothing step, from a level's residual to its
/// solution. Groups are solved for by some iterations with cycles of their own.
void SurfaceLaplacian::cycle(std::size_t l) {
  Level& level = levels_[l];
  const Index size = level.matrix.size();
  if (l + 1 == levels_.size()) {
    if (size > 0) level.solution = coarsest_.solve(level.residual);
    for (Index i = 0; i < size; ++i)
      if (is_still(l, i)) level.solution.row(i).setZero();
    return;
  }
  level.smoothed.resize(size, 3);
  parallel_for(0, size, laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      level.smoothed.row(i) = damping * level.matrix.inverse_diagonal[i] * level.residual.row(i);
  });
  level.solution.resize(size, 3);  // at first the residual that is left
  parallel_for(0, size, laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (is_still(l, i))
        level.solution.row(i).setZero();
      else
        level.solution.row(i) = level.residual.row(i) - level.matrix.times(level.smoothed, i);
  });
  Level& coarser = levels_[l + 1];
  coarser.residual.resize(coarser.matrix.size(), 3);
  parallel_for(0, coarser.matrix.size(), laplacian_grain, [&](Index begin, Index end) {
    for (Index g = begin; g < end; ++g) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      for (std::int32_t at = level.first[g]; at < level.first[g + 1]; ++at)
        sum += level.solution.row(level.members[at]);
      coarser.residual.row(g) = sum;
    }
  });
  conjugate_gradients(l + 1, iterations_on_groups, tolerance_on_groups);
  parallel_for(0, size, laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (const std::int32_t g = level.group_of[i]; g >= 0 && !is_still(l, i))
        level.smoothed.row(i) += coarser.sum.row(g);
  });
  parallel_for(0, size, laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (!is_still(l, i))
        level.solution.row(i) =
            level.smoothed.row(i) + damping * level.matrix.inverse_diagonal[i] *
                                        (level.residual.row(i) - level.matrix.times(level.smoothed, i));
  });
}

/// From a level's residual to the sum of the steps that reduce it. The directions are those of flexible
/// conjugate gradients, since a cycle is no linear map.
void SurfaceLaplacian::conjugate_gradients(std::size_t l, int most, double tolerance) {
  Level& level = levels_[l];
  const Index size = level.matrix.size();
  const auto product = [&](const Points& a, const Points& b) {
    return sum_over(size, [&](Index begin, Index end) {
      double sum = 0.0;
      for (Index i = begin; i < end; ++i) sum += a.row(i).dot(b.row(i));
      return sum;
    });
  };
  cycle(l);
  if (l > 0 && l + 1 == levels_.size()) {  // solved
    level.sum = level.solution;
    return;
  }
  level.sum.setZero(size, 3);
  level.direction = level.solution;
  const double enough = tolerance * tolerance * product(level.residual, level.residual);
  double now = product(level.residual, level.solution);
  for (int iteration = 1; now > 0.0; ++iteration) {
    const double length = now / multiply(l, level.direction, level.image);
    const double left = sum_over(size, [&](Index begin, Index end) {
      const auto rows = [&](auto& all) { return all.middleRows(begin, end - begin); };
      rows(level.sum) += length * rows(level.direction);
      rows(level.residual) -= length * rows(level.image);
      return rows(level.residual).squaredNorm();
    });
    if (iteration == most || left <= enough) break;
    cycle(l);
    const double share = -length * product(level.image, level.solution) / now;
    now = product(level.residual, level.solution);
    parallel_for(0, size, laplacian_grain, [&](Index begin, Index end) {
      const auto rows = [&](auto& all) { return all.middleRows(begin, end - begin); };
      rows(level.direction) = rows(level.solution) + share * rows(level.direction);
    });
  }
}

void SurfaceLaplacian::solve(const Points& residual, const Points& places, double tolerance, Points& x) {
  still_ = held_;
  Points& own = levels_.front().residual;
  own.resize(x.rows(), 3);
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (still_[i])
        own.row(i).setZero();
      else
        own.row(i) = residual.row(i) + bound_[i] * (places.row(i) - x.row(i));
  });
  reduce_residual(tolerance, x);
}

void SurfaceLaplacian::solve_further(const Points& solution, const std::vector<char>& still, double tolerance,
                                     Points& x) {
  Points& image = levels_.front().image;
  multiply(0, x - solution, image);
  still_ = still;
  Points& own = levels_.front().residual;
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (still_[i])
        own.row(i).setZero();
      else
        own.row(i) -= image.row(i);
  });
  reduce_residual(tolerance, x);
}

void SurfaceLaplacian::reduce_residual(double tolerance, Points& x) {
  conjugate_gradients(0, most_iterations, tolerance);
  const Points& sum = levels_.front().sum;
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    x.middleRows(begin, end - begin) += sum.middleRows(begin, end - begin);
  });
}

}  // namespace arapfields
