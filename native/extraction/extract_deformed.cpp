// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/extract_deformed.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/errors.h"
#include "core/frame.h"
#include "core/implicit.h"
#include "core/smoothstep.h"
#include "core/task.h"
#include "distance/signed_distance.h"
#include "extraction/batch_function.h"
#include "fields/inverse.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A rest surface {Φ = 0}, its deformation f, and a mesh of the deformed surface.
struct DeformedShape {
  const ImplicitFunction& rest;
  const DeformationField& field;
  const DeformationField* inverse = nullptr;  ///< a trained one, in its own frame; null: Newton's method
  const TriangleMesh& mesh;                   ///< of the rest surface, mesh coordinates
  const Points& moved;                        ///< f of its vertices
  double band = 0.0;                          ///< a length in mesh coordinates
};

/// Φ∘f⁻¹ in the cube of `frame`, as lengths in that cube. Away from a surface a field need not be invertible,
/// nor a trained inverse be one, and nothing but the sign matters: from `band` to twice that distance from
/// the moved mesh the function passes smoothly into the signed distance to that mesh, which also stands in
/// where no inverse is found beside the surface, and inside of another part that the surface has run into.
class DeformedFunction final : public ImplicitFunction {
 public:
  DeformedFunction(const DeformedShape& shape, const Frame& frame, const Progress& progress);

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override;
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override;
  Frame frame() const override { return frame_; }
  bool continuous() const override { return shape_.rest.continuous(); }

  Index inverted() const { return inverted_; }
  Index failures() const { return failures_; }

 private:
  /// Rest positions of points (mesh coordinates on both sides); NaN where none is found.
  Points by_newton(PointsIn moved) const;
  Points by_network(PointsIn moved) const;
  /// Whether each point (mesh coordinates), just outside of the sheet nearest to it, is inside another one.
  std::vector<bool> covered(PointsIn points) const;

  DeformedShape shape_;
  Frame frame_;
  Progress check_;
  SignedDistance distance_;
  NewtonInverse newton_;
  mutable Index inverted_ = 0, failures_ = 0;
};

namespace {

constexpr double newton_tolerance = 1e-4;  // a fiftieth of it is aimed at
constexpr Index most_starts = 50000;
constexpr double search_radius_in_bands = 10.0;  // room for compressions to a fifth
constexpr double probe_in_bands = 0.5;           // how far outside of a sheet to ask for others
constexpr double residual_in_bands = 0.5;        // what a trained inverse may be off by

Points some_rows(const Points& points, Index most) {
  const Index every = std::max<Index>(1, points.rows() / most), count = points.rows() / every;
  Points result(count, 3);
  for (Index i = 0; i < count; ++i) result.row(i) = points.row(i * every);
  return result;
}

}  // namespace

DeformedFunction::DeformedFunction(const DeformedShape& shape, const Frame& frame, const Progress& progress)
    : shape_(shape),
      frame_(frame),
      check_(progress.part(0.0, 0.0)),
      distance_(shape.moved, shape.mesh.triangles, progress),
      newton_(shape.field,
              shape.inverse != nullptr
                  ? Points(0, 3)
                  : shape.field.frame().to_cube(some_rows(shape.mesh.vertices, most_starts)),
              check_) {}

Points DeformedFunction::by_newton(PointsIn moved) const {
  const Frame& cube = shape_.field.frame();
  NewtonInverseOptions options;
  options.tolerance = newton_tolerance;
  options.max_distance = search_radius_in_bands * shape_.band / cube.scale;
  return cube.to_mesh(newton_(cube.to_cube(moved), options, check_).points);
}

Points DeformedFunction::by_network(PointsIn moved) const {
  const Frame &inner = shape_.inverse->frame(), &outer = shape_.field.frame();
  Points rest(moved.rows(), 3), back(moved.rows(), 3);
  shape_.inverse->evaluate(inner.to_cube(moved), {rest.data(), rest.rows(), JetOrder::value});
  rest = inner.to_mesh(rest);
  shape_.field.evaluate(outer.to_cube(rest), {back.data(), back.rows(), JetOrder::value});
  const Vector residual = (outer.to_mesh(back) - moved).rowwise().norm();
  for (Index i = 0; i < rest.rows(); ++i)
    if (!(residual[i] <= residual_in_bands * shape_.band))
      rest.row(i).setConstant(std::numeric_limits<double>::quiet_NaN());
  return rest;
}

std::vector<bool> DeformedFunction::covered(PointsIn points) const {
  ClosestPoints closest = distance_.closest(points, check_);
  for (Index i = 0; i < points.rows(); ++i) {
    const auto corners = shape_.mesh.triangles.row(closest.triangles[i]);
    const Vec3 a = shape_.moved.row(corners[0]), b = shape_.moved.row(corners[1]),
               c = shape_.moved.row(corners[2]);
    closest.points.row(i) += probe_in_bands * shape_.band * (b - a).cross(c - a).normalized().transpose();
  }
  Vector winding(points.rows());
  distance_.winding_number(closest.points, winding, check_);
  std::vector<bool> result;
  for (const double number : winding) result.push_back(number > 0.5);
  return result;
}

void DeformedFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  const Points mesh = frame_.to_mesh(points.cast<double>());
  Vector distances(mesh.rows());
  distance_.evaluate(mesh, distances, check_);
  std::vector<Index> near;
  for (Index i = 0; i < mesh.rows(); ++i)
    if (std::abs(distances[i]) < 2.0 * shape_.band) near.push_back(i);
  const Points moved = mesh(near, Eigen::all);
  const Points rest = shape_.inverse != nullptr ? by_network(moved) : by_newton(moved);
  std::vector<Index> inverted, rows, ambiguous;  // rows of near, of points; of points again
  for (std::size_t k = 0; k < near.size(); ++k)
    if (rest.row(k).allFinite()) {
      inverted.push_back(static_cast<Index>(k));
      rows.push_back(near[k]);
    }
  const PointsF at = shape_.rest.frame().to_cube(rest(inverted, Eigen::all)).cast<float>();
  VectorF phi(at.rows());
  shape_.rest.evaluate(at, phi);
  Vector exact = distances;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    double& value = exact[rows[k]];
    value = static_cast<double>(phi[k]) * shape_.rest.frame().scale;
    const double distance = distances[rows[k]];
    const bool beside = std::abs(distance) > probe_in_bands * shape_.band;
    if (!continuous() && beside && (value < 0.0) != (distance < 0.0))
      value = distance;  // both jump, and need not at the same place: no zero between the two
    else if (value > 0.0 && distance < 0.0)
      ambiguous.push_back(rows[k]);
  }
  const std::vector<bool> inside = covered(mesh(ambiguous, Eigen::all));
  for (std::size_t k = 0; k < ambiguous.size(); ++k)
    if (inside[k] || distances[ambiguous[k]] < -probe_in_bands * shape_.band)
      exact[ambiguous[k]] = distances[ambiguous[k]];
  for (Index i = 0; i < mesh.rows(); ++i)
    exact[i] +=
        smoothstep(shape_.band, 2.0 * shape_.band, std::abs(distances[i])) * (distances[i] - exact[i]);
  inverted_ += static_cast<Index>(near.size());
  failures_ += static_cast<Index>(near.size() - inverted.size());
  values = (exact / frame_.scale).cast<float>();
}

void DeformedFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                                Eigen::Ref<PointsF> gradients) const {
  BatchFunction([this](ConstPointsRef<float> at, Eigen::Ref<VectorF> out) {
    evaluate(at, out);
  }).evaluate(points, values, gradients);
}

namespace {

constexpr double half_extent = 0.9;     // of the deformed surface in the cube
constexpr double band_in_cells = 2.0;   // where Φ∘f⁻¹ is the function, and its steepest
constexpr double share_at_rest = 0.15;  // of the work

}  // namespace

TriangleMesh extract_deformed(const ImplicitFunction& rest, const DeformationField& field,
                              const DeformationField* inverse, const ExtractionOptions& options,
                              const Progress& progress, DeformedReport* report) {
  options.validate();
  const int resolution = options.resolution;
  const TriangleMesh mesh = extract_surface(rest, options, progress.part(0.0, share_at_rest));
  Points moved = values_at(field, field.frame().to_cube(mesh.vertices), progress);
  require(moved.allFinite(), "field", "its values are NaN or infinite on the surface",
          "a finite deformation is needed");
  moved = field.frame().to_mesh(moved);
  const Frame frame = Frame::around(moved, half_extent);
  const double spacing = 2.0 / (resolution - 1) * std::max(frame.scale, rest.frame().scale);
  const DeformedShape shape{.rest = rest,
                            .field = field,
                            .inverse = inverse,
                            .mesh = mesh,
                            .moved = moved,
                            .band = band_in_cells * spacing};
  progress.report(share_at_rest, "inverting the field");
  const DeformedFunction function(shape, frame, progress);
  ExtractionReport done;
  TriangleMesh result = extract_surface(function, options, progress.part(share_at_rest, 1.0), &done);
  if (report != nullptr) {
    static_cast<ExtractionReport&>(*report) = done;
    report->inverted = function.inverted();
    report->failures = function.failures();
    report->spacing = 2.0 / (resolution - 1) * frame.scale;
  }
  return result;
}

}  // namespace arapfields
