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
constexpr int most_iterations = 12;
/// Weight of an edge relative to the root of its nodes' diagonals, from which on it joins them in one group.
constexpr double joining = 0.08;
constexpr Index laplacian_grain = 4096;

/// A symmetric matrix without its diagonal, as neighbours and weights of each row.
struct Graph {
  std::vector<std::int32_t> first = {0}, neighbour;
  std::vector<double> weight;
  Vector diagonal;
  std::vector<char> held;
  Index size() const { return static_cast<Index>(first.size()) - 1; }
};

/// Each free node and its free neighbours by strong edges, where none of them is in a group yet; what is left
/// joins the group of its strongest neighbour.
std::vector<std::int32_t> groups_of(const Graph& graph, Index& count) {
  std::vector<std::int32_t> group(graph.size(), -1);
  count = 0;
  const auto each = [&](Index i, auto&& visit) {
    for (std::int32_t at = graph.first[i]; at < graph.first[i + 1]; ++at)
      if (!graph.held[graph.neighbour[at]]) visit(graph.neighbour[at], graph.weight[at]);
  };
  for (Index i = 0; i < graph.size(); ++i) {
    const auto each_joined = [&](auto&& visit) {
      each(i, [&](Index j, double weight) {
        if (weight > joining * std::sqrt(graph.diagonal[i] * graph.diagonal[j])) visit(j);
      });
    };
    bool open = !graph.held[i] && group[i] < 0;
    if (open) each_joined([&](Index j) { open = open && group[j] < 0; });
    if (!open) continue;
    group[i] = static_cast<std::int32_t>(count++);
    each_joined([&](Index j) { group[j] = group[i]; });
  }
  std::vector<std::int32_t> result = group;
  for (Index i = 0; i < graph.size(); ++i) {
    if (graph.held[i] || group[i] >= 0) continue;
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
Graph grouped(const Graph& graph, const std::vector<std::int32_t>& group_of, Index count,
              const std::vector<std::int32_t>& first, const std::vector<std::int32_t>& members) {
  Graph result;
  result.diagonal.setZero(count);
  result.held.assign(count, 0);
  std::vector<std::pair<std::int32_t, double>> row;
  for (Index g = 0; g < count; ++g) {
    row.clear();
    for (std::int32_t at = first[g]; at < first[g + 1]; ++at) {
      const std::int32_t i = members[at];
      result.diagonal[g] += graph.diagonal[i];
      for (std::int32_t e = graph.first[i]; e < graph.first[i + 1]; ++e) {
        const std::int32_t other = group_of[graph.neighbour[e]];
        if (other == g)
          result.diagonal[g] -= graph.weight[e];
        else if (other >= 0)
          row.emplace_back(other, graph.weight[e]);
      }
    }
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
  return result;
}

/// Σ of body(begin, end) over chunks of nodes, in an order that follows from their number alone.
template <class Body>
double sum_over(Index nodes, const Body& body) {
  Vector parts = Vector::Zero((nodes + laplacian_grain - 1) / laplacian_grain);
  parallel_for(0, nodes, laplacian_grain,
               [&](Index begin, Index end) { parts[begin / laplacian_grain] = body(begin, end); });
  return parts.sum();
}

}  // namespace

SurfaceLaplacian::SurfaceLaplacian(const WeldedSurface& surface, const Vector& factors,
                                   const std::vector<char>& held, const Progress& progress,
                                   const Vector& bound)
    : surface_(surface), weight_(surface.edge_weights(factors)), held_(held) {
  Graph graph;
  graph.first = surface.first_neighbour();
  graph.neighbour = surface.neighbours();
  graph.weight = weight_;
  graph.held = held;
  graph.diagonal.setZero(surface.nodes());
  for (Index i = 0; i < surface.nodes(); ++i)
    for (std::int32_t at = graph.first[i]; at < graph.first[i + 1]; ++at) graph.diagonal[i] += weight_[at];
  bound_ = bound.size() > 0 ? bound : Vector(binding * graph.diagonal);
  graph.diagonal += bound_;
  diagonal_ = graph.diagonal;
  inverse_diagonal_ = diagonal_.cwiseInverse();

  for (Index size = graph.size(); size > coarsest_size;) {
    progress.check();
    Level level;
    Index count = 0;
    level.group_of = groups_of(graph, count);
    level.first.assign(count + 1, 0);
    for (const std::int32_t g : level.group_of)
      if (g >= 0) ++level.first[g + 1];
    for (Index g = 0; g < count; ++g) level.first[g + 1] += level.first[g];
    level.members.resize(level.first.back());
    std::vector<std::int32_t> free(level.first.begin(), level.first.end() - 1);
    for (Index i = 0; i < graph.size(); ++i)
      if (level.group_of[i] >= 0) level.members[free[level.group_of[i]]++] = static_cast<std::int32_t>(i);
    graph = grouped(graph, level.group_of, count, level.first, level.members);
    level.inverse_diagonal = graph.diagonal.cwiseInverse();
    levels_.push_back(std::move(level));
    if (count == size) break;  // pieces of one group each
    size = count;
  }

  std::vector<Eigen::Triplet<double>> entries;
  for (Index i = 0; i < graph.size(); ++i) {
    entries.emplace_back(i, i, graph.diagonal[i]);
    if (graph.held[i]) continue;
    for (std::int32_t at = graph.first[i]; at < graph.first[i + 1]; ++at)
      if (graph.neighbour[at] < i && !graph.held[graph.neighbour[at]])
        entries.emplace_back(i, graph.neighbour[at], -graph.weight[at]);
  }
  Eigen::SparseMatrix<double> matrix(graph.size(), graph.size());
  matrix.setFromTriplets(entries.begin(), entries.end());
  progress.check();
  if (graph.size() > 0) coarsest_.compute(matrix);
}

double SurfaceLaplacian::multiply(const Points& x, Points& product) const {
  product.resize(x.rows(), 3);
  const std::vector<std::int32_t>&first = surface_.first_neighbour(), &neighbours = surface_.neighbours();
  return sum_over(x.rows(), [&](Index begin, Index end) {
    double inner = 0.0;
    for (Index i = begin; i < end; ++i) {
      Vec3 sum = Vec3::Zero();
      if (!still_[i]) {
        sum = diagonal_[i] * x.row(i);
        for (std::int32_t at = first[i]; at < first[i + 1]; ++at) sum -= weight_[at] * x.row(neighbours[at]);
      }
      product.row(i) = sum;
      inner += sum.dot(x.row(i));
    }
    return inner;
  });
}

double SurfaceLaplacian::precondition(const Points& residual, Points& step) {
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    Level& level = levels_[l];
    const Points& fine = l == 0 ? residual : levels_[l - 1].sums;
    level.sums.resize(static_cast<Index>(level.first.size()) - 1, 3);
    parallel_for(0, level.sums.rows(), laplacian_grain, [&](Index begin, Index end) {
      for (Index g = begin; g < end; ++g) {
        Vec3 sum = Vec3::Zero();
        for (std::int32_t at = level.first[g]; at < level.first[g + 1]; ++at)
          sum += fine.row(level.members[at]);
        level.sums.row(g) = sum;
      }
    });
  }
  const Points& coarsest = levels_.empty() ? residual : levels_.back().sums;
  Points& solved = levels_.empty() ? step : levels_.back().correction;
  if (coarsest.rows() > 0) solved = coarsest_.solve(coarsest);
  for (std::size_t l = levels_.size(); l-- > 0;) {
    const Points& fine = l == 0 ? residual : levels_[l - 1].sums;
    const Vector& inverse = l == 0 ? inverse_diagonal_ : levels_[l - 1].inverse_diagonal;
    Points& finer = l == 0 ? step : levels_[l - 1].correction;
    finer.resize(fine.rows(), 3);
    parallel_for(0, fine.rows(), laplacian_grain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const std::int32_t g = levels_[l].group_of[i];
        finer.row(i) = inverse[i] * fine.row(i);
        if (g >= 0) finer.row(i) += levels_[l].correction.row(g);
        if (l == 0 && still_[i]) finer.row(i).setZero();
      }
    });
  }
  if (levels_.empty())
    for (Index i = 0; i < step.rows(); ++i)
      if (still_[i]) step.row(i).setZero();
  return sum_over(residual.rows(), [&](Index begin, Index end) {
    return residual.middleRows(begin, end - begin).cwiseProduct(step.middleRows(begin, end - begin)).sum();
  });
}

void SurfaceLaplacian::solve(const Points& residual, const Points& places, double tolerance, Points& x) {
  still_ = held_;
  residual_.resize(x.rows(), 3);
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (still_[i])
        residual_.row(i).setZero();
      else
        residual_.row(i) = residual.row(i) + bound_[i] * (places.row(i) - x.row(i));
  });
  reduce_residual(tolerance, x);
}

void SurfaceLaplacian::solve_further(const Points& solution, const std::vector<char>& still, double tolerance,
                                     Points& x) {
  multiply(x - solution, image_);
  still_ = still;
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (still_[i])
        residual_.row(i).setZero();
      else
        residual_.row(i) -= image_.row(i);
  });
  reduce_residual(tolerance, x);
}

void SurfaceLaplacian::reduce_residual(double tolerance, Points& x) {
  double product_now = precondition(residual_, step_);
  direction_ = step_;
  const double enough = tolerance * tolerance * product_now;
  for (int iteration = 0; iteration < most_iterations && product_now > enough; ++iteration) {
    const double length = product_now / multiply(direction_, image_);
    parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
      const auto rows = [&](auto& all) { return all.middleRows(begin, end - begin); };
      rows(x) += length * rows(direction_);
      rows(residual_) -= length * rows(image_);
    });
    const double product_next = precondition(residual_, step_), share = product_next / product_now;
    parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
      const auto rows = [&](auto& all) { return all.middleRows(begin, end - begin); };
      rows(direction_) = rows(step_) + share * rows(direction_);
    });
    product_now = product_next;
  }
}

}  // namespace arapfields
