// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "core/task.h"
#include "sharpen/welded_surface.h"

namespace arapfields {

/// The constant system of a surface's global steps: Σ of its triangles' edges w (x_i − x_j)², a weight for
/// each triangle times its cotangents, with some nodes held, and all others bound to places of theirs.
/// Conjugate gradients solve it from the last positions on. They are preconditioned by groups of nodes at
/// several scales (Bramble, Pasciak and Xu 1990, "Parallel Multilevel Preconditioners"), of which a sparse
/// Cholesky factor solves the coarsest: the factor of all nodes takes minutes for half a million of them.
class SurfaceLaplacian {
 public:
  /// `factors` (m') of the triangles; `held` (k) 1 for nodes that stay; `bound` (k) weights that bind nodes
  /// to their places, or empty: weak ones. `surface` must outlive it.
  SurfaceLaplacian(const WeldedSurface& surface, const Vector& factors, const std::vector<char>& held,
                   const Progress& progress, const Vector& bound = {});

  /// Moves x (k,3) towards the solution, until the residual is `tolerance` of that at the start: (k,3) of the
  /// edges at x, and of the pull to `places` (k,3), those that nodes are bound to.
  void solve(const Points& residual, const Points& places, double tolerance, Points& x);

  /// Goes on after some nodes have been moved from `solution`, the last x, to where x is now; `still` (k): 1
  /// for nodes that stay from now on, the held ones among them.
  void solve_further(const Points& solution, const std::vector<char>& still, double tolerance, Points& x);

 private:
  /// Groups of the nodes of the level before.
  struct Level {
    std::vector<std::int32_t> group_of;  // of each node there
    std::vector<std::int32_t> first;     // of each group in `members`, and the end
    std::vector<std::int32_t> members;   // nodes of the groups
    Vector inverse_diagonal;             // of the groups' matrix; of the coarsest, unused
    Points sums, correction;             // of the groups, while it preconditions
  };
  /// Both return the sum of the products of their two entries.
  double multiply(const Points& x, Points& product) const;
  double precondition(const Points& residual, Points& step);
  void reduce_residual(double tolerance, Points& x);

  const WeldedSurface& surface_;
  std::vector<double> weight_;  // of the surface's edges
  Vector diagonal_;
  Vector inverse_diagonal_;
  Vector bound_;  // weights that bind nodes to their places
  std::vector<char> held_, still_;
  std::vector<Level> levels_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> coarsest_;
  Points residual_, step_, direction_, image_;  // while it solves
};

}  // namespace arapfields
