// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "core/point_grid.h"
#include "fields/radial_evaluator.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// The contact points of a rest surface: a subset of its samples, and mesh vertices that stick out of them
/// (sampling/standing_out.h).
struct FollowedPlaces {
  /// `order` is a spatially coherent permutation of the samples. Throws Cancelled.
  FollowedPlaces(const SurfaceSamples& surface, const std::vector<std::uint32_t>& order, std::uint64_t seed,
                 const Progress& progress);

  std::vector<Index> samples;  ///< rows of the surface's samples
  std::vector<Index> parents;  ///< for each vertex the nearest entry of `samples`
  Points rest;                 ///< (n,3) cube coordinates: the samples, then the vertices
  double spacing = 0.0;        ///< mean sample spacing: square root of the area of a sample
};

/// Points around some samples that are denser than the samples: they follow them in the rows of
/// ContactPoints.
struct RefinedPoints {
  std::vector<Index> samples;  ///< that have refined points
  std::vector<Index> parents;  ///< the sample of each point
  Points rest = Points(0, 3);
  Points embedded = Points(0, 3);  ///< in the basis' interior embedding; empty without one
  Revision revision = 0;           ///< of these points; 0: none
};

/// The points of a surface at which contact is enforced: samples, then mesh vertices that stick out of the
/// samples (sampling/standing_out.h), then refined points around samples at an obstacle's edge, which would
/// otherwise poke through between samples. Which points are refined is a value of the caller's.
class ContactPoints {
 public:
  using Refined = std::shared_ptr<const RefinedPoints>;
  explicit ContactPoints(const RadialProblem& problem) : problem_(problem) {}
  /// Takes the samples and vertices of the rest shape, once. Throws Cancelled.
  void choose(const Progress& progress = {});
  /// Rows of the problem's samples that are contact points.
  const std::vector<Index>& samples() const { return samples_; }
  Index sample_count() const { return static_cast<Index>(samples_.size()); }
  /// Number of samples and vertices.
  Index coarse_count() const { return rest_.rows(); }
  /// Number of samples, vertices and refined points, which are stored in this order.
  Index size(const RefinedPoints& refined) const { return rest_.rows() + refined.rest.rows(); }
  /// The sample itself, or the parent sample of a vertex or refined point.
  Index sample_of(Index row, const RefinedPoints& refined) const;
  /// The area weight of a point, as a fraction of the surface's area.
  double area(Index row) const;
  Points rest(const std::vector<Index>& rows, const RefinedPoints& refined) const;
  /// Rest positions in the basis' interior embedding; empty without one.
  Points embedded(const std::vector<Index>& rows, const RefinedPoints& refined) const;
  /// Rest positions of samples.
  Points rest(const std::vector<Index>& samples) const { return rest_(samples, Eigen::all); }
  /// Unit rest normals of samples; zero if the samples have no normals.
  Points normals(const std::vector<Index>& samples) const;
  /// Mean sample spacing: the square root of the area of a sample, in cube units.
  double spacing() const { return spacing_; }
  /// Samples near one at rest whose normals are on the same side; the sample itself is the first.
  const std::vector<Index>& neighbours(Index sample);
  /// No refined points.
  static Refined unrefined() { return std::make_shared<const RefinedPoints>(); }
  /// With refined points around samples that have none yet; itself, if there are none.
  Refined refine(const Refined& refined, const std::vector<Index>& samples);
  /// A hash of the rest positions of samples and vertices: equal for solvers on the same samples.
  std::uint64_t identity() const;

  /// Positions (size(),3) under the field with these coefficients.
  Points at(const RowMatrix<double>& coefficients, const RefinedPoints& refined);
  /// Whether these are the coefficients of the last positions.
  bool is_at(const RowMatrix<double>& coefficients) const {
    return coefficients.rows() == coefficients_.rows() && coefficients == coefficients_;
  }
  /// Deformed normals of the samples, scaled by the local area ratio. With `blocks`, only those of these
  /// blocks of the evaluator; the others are zero.
  Points normals_at(const RowMatrix<double>& coefficients, const std::vector<Index>* blocks = nullptr);

 private:
  const Points& finer(Index sample);
  Points made_finer(Index sample);
  Points embedded_at(PointsIn places) const;

  const RadialProblem& problem_;
  std::vector<Index> samples_;
  std::vector<Index> parents_;    // the sample of each vertex
  Points rest_ = Points(0, 3);    // of samples and vertices
  Points embedded_;               // rest_ in the basis' interior embedding
  std::map<Index, Points> made_;  // refined points of each sample that ever had some
  Revision refinements_ = 0;
  double spacing_ = 0.0;
  std::unique_ptr<PointGrid> grid_;       // of the samples
  std::vector<Index> cells_;              // the cell of each sample
  std::vector<std::vector<Index>> near_;  // cached neighbours of each sample
  Dependent<RadialEvaluator<float>, 1> evaluator_;
  Dependent<RadialEvaluator<float>, 1> finer_;
  RowMatrix<double> coefficients_;               // of places_
  Points places_;                                // of samples and vertices
  Dependent<RadialEvaluator<float>, 1> slopes_;  // first derivatives at the samples
};

}  // namespace arapfields
