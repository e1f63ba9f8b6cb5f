// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <cstdint>
#include <vector>

#include "core/task.h"
#include "mesh/triangle_mesh.h"
#include "wrap/smooth_map.h"

// Transfer of displacements from one mesh to another by their differences along edges.

namespace arapfields {

/// Points (n) on a mesh, by triangles and barycentric coordinates.
struct SurfacePlaces {
  std::vector<std::int32_t> triangles;  ///< (n)
  Points shares;                        ///< (n,3) barycentric coordinates, ≥ 0
  Vector distances;                     ///< (n) from the query points, in mesh units

  /// Values of the mesh's vertices at point i, interpolated linearly: at(v) is that of vertex v.
  template <class At>
  auto interpolated(const Triangles& mesh, Index i, At&& at) const {
    const auto corner = [&](int k) { return shares(i, k) * at(mesh(triangles[i], k)); };
    return (corner(0) + corner(1) + corner(2)).eval();
  }
};

/// The point of a mesh closest to each point (n,3), preferably on a side whose normal agrees with the point's
/// normal (n,3), since thin parts have two sides. A normal of length 0 takes either side.
SurfacePlaces places_on(const TriangleMesh& mesh, PointsIn points, PointsIn normals,
                        const Progress& progress = {});

/// Displacements u on a mesh whose differences along edges follow those that a map M carries over from a
/// giving mesh: argmin Σ w ‖u_i − u_j − d_ij‖² + Σ a ‖u − M(δ)‖² / L², with cotangent weights w and areas a.
/// d_ij is M(δ)_i − M(δ)_j where the map fits, J (δ_i − δ_j) where it does not, and by gradients of δ where
/// the places contradict the edge, which keeps folds out. One factor serves any number of δ. Source: Sumner
/// and Popović 2004, "Deformation Transfer for Triangle Meshes", section 3.
class CarriedMotion {
 public:
  /// `places` of the receiving vertices lie on the giving mesh, each in its own space; `map`, at the
  /// receiving vertices, leads from the second to the first. Throws Cancelled.
  CarriedMotion(const TriangleMesh& giving, const TriangleMesh& receiving, const SurfacePlaces& places,
                DisplacementMap map, const Progress& progress = {});

  /// Displacements (m,3) of the giving vertices: (n,3) of the receiving ones. Throws Cancelled.
  Points operator()(PointsIn given, const Progress& progress = {}) const;

 private:
  struct Edge {
    std::int32_t begin;
    std::int32_t end;
    double weight;
    Mat3 jacobian;
    /// The edge on the giving mesh where the places there contradict it, else 0: then gradients are carried.
    Vec3 back;
  };
  void add_edges();
  std::vector<Mat3> gradients(PointsIn given) const;
  /// Halves `kept` at triangles that fold where the giving mesh does not; whether there are any.
  bool spare_folds(PointsIn given, const Points& moved, Vector& kept) const;

  TriangleMesh giving_;
  TriangleMesh receiving_;
  SurfacePlaces places_;
  std::vector<std::int32_t> first_;  // of each receiving vertex, the first at its position
  std::vector<std::int32_t> giving_first_;
  DisplacementMap map_;
  std::vector<Mat3> jacobians_;  // of the map, smoothed
  std::vector<Edge> edges_;
  std::vector<Eigen::Matrix<double, 3, 2>> slopes_;  // of giving triangles: differences to gradients
  Vector giving_areas_;
  Vector anchors_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace arapfields
