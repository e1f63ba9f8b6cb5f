// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "core/task.h"
#include "sharpen/welded_surface.h"

namespace arapfields {

/// The constant system of a surface's global steps: Σ of its triangles' edges w (x_i − x_j)², a weight for
/// each triangle times its cotangents, with some nodes held, and all others bound to places of theirs.
/// Conjugate gradients solve it from the last positions on. They are preconditioned by cycles over groups of
/// nodes (Notay 2010, "An aggregation-based algebraic multigrid method"), of which a sparse Cholesky factor
/// solves the coarsest: the factor of all nodes takes minutes for half a million of them.
class SurfaceLaplacian {
 public:
  /// `factors` (m') of the triangles; `held` (k) 1 for nodes that stay; `bound` (k) weights that bind nodes
  /// to their places, or empty: weak ones.
  SurfaceLaplacian(const WeldedSurface& surface, const Vector& factors, const std::vector<char>& held,
                   const Progress& progress, const Vector& bound = {});

  /// Moves x (k,3) towards the solution, until the residual is `tolerance` of that at the start: (k,3) of the
  /// edges at x, and of the pull to `places` (k,3), those that nodes are bound to.
  void solve(const Points& residual, const Points& places, double tolerance, Points& x);

  /// Goes on after some nodes have been moved from `solution`, the last x, to where x is now; `still` (k): 1
  /// for nodes that stay from now on, the held ones among them.
  void solve_further(const Points& solution, const std::vector<char>& still, double tolerance, Points& x);

 private:
  /// A symmetric matrix, as its diagonal and the neighbours of each row with their weights: entries of the
  /// other sign.
  struct Matrix {
    std::vector<std::int32_t> first = {0}, neighbour;
    std::vector<double> weight;
    Vector diagonal, inverse_diagonal;
    std::vector<char> held;  // rows that are no unknowns
    Index size() const { return static_cast<Index>(first.size()) - 1; }
    Eigen::RowVector3d times(const Points& x, Index row) const {
      Eigen::RowVector3d sum = diagonal[row] * x.row(row);
      for (std::int32_t at = first[row]; at < first[row + 1]; ++at) sum -= weight[at] * x.row(neighbour[at]);
      return sum;
    }
  };
  /// A scale: its matrix, and the groups of its nodes, which are the nodes of the next one.
  struct Level {
    Matrix matrix;
    std::vector<std::int32_t> group_of;  // of each node
    std::vector<std::int32_t> first;     // of each group in `members`, and the end
    std::vector<std::int32_t> members;   // nodes of the groups
    // Of its nodes, while it solves: the residual, a cycle's result before and after the last smoothing, the
    // direction and its image, and the sum of the steps.
    Points residual, smoothed, solution, direction, image, sum;
  };
  static std::vector<std::int32_t> groups_of(const Matrix& matrix, Index& count);
  static Matrix grouped(const Level& level, Index count);

  bool is_still(std::size_t level, Index node) const { return level == 0 && still_[node]; }
  /// Returns x · product.
  double multiply(std::size_t level, const Points& x, Points& product) const;
  void cycle(std::size_t level);
  void conjugate_gradients(std::size_t level, int most, double tolerance);
  void reduce_residual(double tolerance, Points& x);

  std::vector<char> held_, still_;
  Vector bound_;               // weights that bind nodes to their places
  std::vector<Level> levels_;  // the last one's matrix has a factor, and no groups
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> coarsest_;
};

}  // namespace arapfields
