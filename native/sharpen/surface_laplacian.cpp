// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/surface_laplacian.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// Groups that a factor solves for.
constexpr Index coarsest_size = 1500;
/// Weight that binds a node to its place weakly, relative to its diagonal.
constexpr double binding = 1e-7;
constexpr int most_iterations = 12;
constexpr Index laplacian_grain = 4096;

/// A symmetric matrix without its diagonal, as neighbours and weights of each row.
struct Graph {
  std::vector<std::int32_t> first = {0}, neighbour;
  std::vector<double> weight;
  Vector diagonal;
  std::vector<char> held;
  Index size() const { return static_cast<Index>(first.size()) - 1; }
};

/// Each free node and its free neighbours that are in no group yet, where none of them is; what is left joins
/// the group of its nearest neighbour.
std::vector<std::int32_t> groups_of(const Graph& graph, Index& count) {
  std::vector<std::int32_t> group(graph.size(), -1);
  count = 0;
  const auto each = [&](Index i, auto&& visit) {
    for (std::int32_t at = graph.first[i]; at < graph.first[i + 1]; ++at)
      if (!graph.held[graph.neighbour[at]]) visit(graph.neighbour[at], graph.weight[at]);
  };
  for (Index i = 0; i < graph.size(); ++i) {
    bool open = !graph.held[i] && group[i] < 0;
    if (open) each(i, [&](Index j, double) { open = open && group[j] < 0; });
    if (!open) continue;
    group[i] = static_cast<std::int32_t>(count++);
    each(i, [&](Index j, double) { group[j] = group[i]; });
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

/// Σ of the products of entries, in an order that follows from the size alone.
double inner(const Points& a, const Points& b) {
  const Index chunks = (a.rows() + laplacian_grain - 1) / laplacian_grain;
  Vector parts(chunks);
  parallel_for(0, chunks, 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) {
      const Index from = c * laplacian_grain, rows = std::min(laplacian_grain, a.rows() - from);
      parts[c] = a.middleRows(from, rows).cwiseProduct(b.middleRows(from, rows)).sum();
    }
  });
  return parts.sum();
}

/// a += factor · b.
void add(double factor, const Points& b, Points& a) {
  parallel_for(0, a.rows(), laplacian_grain, [&](Index begin, Index end) {
    a.middleRows(begin, end - begin) += factor * b.middleRows(begin, end - begin);
  });
}

}  // namespace

SurfaceLaplacian::SurfaceLaplacian(const WeldedSurface& surface, const Vector& factors,
                                   const std::vector<char>& held, const Progress& progress,
                                   const Vector& bound)
    : held_(held) {
  Graph graph;
  graph.held = held;
  graph.diagonal.setZero(surface.nodes());
  std::vector<std::pair<std::int32_t, double>> row;
  for (Index i = 0; i < surface.nodes(); ++i) {
    if (i % 16384 == 0) progress.check();
    row.clear();
    surface.around(i, [&](Index t, int k) {
      for (int other = 1; other < 3; ++other) {
        const int l = (k + other) % 3;
        row.emplace_back(surface.corners()(t, l), factors[t] * surface.weights()(t, 3 - k - l));
      }
    });
    std::sort(row.begin(), row.end());
    for (std::size_t k = 0; k < row.size(); ++k) {
      graph.diagonal[i] += row[k].second;
      if (k > 0 && row[k].first == row[k - 1].first) {
        graph.weight.back() += row[k].second;
        continue;
      }
      graph.neighbour.push_back(row[k].first);
      graph.weight.push_back(row[k].second);
    }
    graph.first.push_back(static_cast<std::int32_t>(graph.neighbour.size()));
  }
  bound_ = bound.size() > 0 ? bound : Vector(binding * graph.diagonal);
  graph.diagonal += bound_;
  first_ = graph.first, neighbour_ = graph.neighbour, weight_ = graph.weight, diagonal_ = graph.diagonal;
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

Points SurfaceLaplacian::product(const Points& x) const {
  Points result(x.rows(), 3);
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Eigen::RowVector3d sum = diagonal_[i] * x.row(i);
      for (std::int32_t at = first_[i]; at < first_[i + 1]; ++at) sum -= weight_[at] * x.row(neighbour_[at]);
      result.row(i) = held_[i] ? Eigen::RowVector3d::Zero() : sum;
    }
  });
  return result;
}

Points SurfaceLaplacian::preconditioned(const Points& residual) const {
  std::vector<Points> sums;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    const Level& level = levels_[l];
    const Points& fine = l == 0 ? residual : sums.back();
    Points coarse(static_cast<Index>(level.first.size()) - 1, 3);
    parallel_for(0, coarse.rows(), laplacian_grain, [&](Index begin, Index end) {
      for (Index g = begin; g < end; ++g) {
        Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
        for (std::int32_t at = level.first[g]; at < level.first[g + 1]; ++at)
          sum += fine.row(level.members[at]);
        coarse.row(g) = sum;
      }
    });
    sums.push_back(std::move(coarse));
  }
  const Points& coarsest = levels_.empty() ? residual : sums.back();
  Points correction = coarsest;
  if (coarsest.rows() > 0) correction = coarsest_.solve(coarsest).eval();
  for (std::size_t l = levels_.size(); l-- > 0;) {
    const Points& fine = l == 0 ? residual : sums[l - 1];
    const Vector& inverse = l == 0 ? inverse_diagonal_ : levels_[l - 1].inverse_diagonal;
    Points finer(fine.rows(), 3);
    parallel_for(0, fine.rows(), laplacian_grain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const std::int32_t g = levels_[l].group_of[i];
        finer.row(i) = inverse[i] * fine.row(i);
        if (g >= 0) finer.row(i) += correction.row(g);
      }
    });
    correction = std::move(finer);
  }
  return correction;
}

void SurfaceLaplacian::solve(const Points& right, const Points& places, double tolerance, Points& x) const {
  Points residual = product(x);
  parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (!held_[i]) residual.row(i) = right.row(i) + bound_[i] * places.row(i) - residual.row(i);
  });
  Points step = preconditioned(residual);
  Points direction = step;
  double product_now = inner(residual, step);
  const double enough = tolerance * tolerance * product_now;
  for (int iteration = 0; iteration < most_iterations && product_now > enough; ++iteration) {
    const Points image = product(direction);
    const double length = product_now / inner(direction, image);
    add(length, direction, x);
    add(-length, image, residual);
    step = preconditioned(residual);
    const double product_next = inner(residual, step), share = product_next / product_now;
    parallel_for(0, x.rows(), laplacian_grain, [&](Index begin, Index end) {
      direction.middleRows(begin, end - begin) =
          step.middleRows(begin, end - begin) + share * direction.middleRows(begin, end - begin);
    });
    product_now = product_next;
  }
}

}  // namespace arapfields
