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

/// The points of a surface at which contact is enforced: samples, then mesh vertices that stick out of the
/// samples (sampling/standing_out.h), then refined points around samples at an obstacle's edge, which would
/// otherwise poke through between samples.
class ContactPoints {
 public:
  explicit ContactPoints(const RadialProblem& problem) : problem_(problem) {}
  /// Takes the samples and vertices of the rest shape, once. Throws Cancelled.
  void choose(const Progress& progress = {});
  bool empty() const { return samples_.empty(); }
  /// Rows of the problem's samples that are contact points.
  const std::vector<Index>& samples() const { return samples_; }
  /// Number of samples, vertices and refined points, which are stored in this order.
  Index size() const { return rest_.rows(); }
  Index sample_count() const { return static_cast<Index>(samples_.size()); }
  /// Number of samples and vertices.
  Index coarse_count() const { return coarse_; }
  /// The sample itself, or the parent sample of a vertex or refined point.
  Index sample_of(Index row) const;
  /// The area weight of a point, as a fraction of the surface's area.
  double area(Index row) const;
  Points rest(const std::vector<Index>& rows) const;
  /// Rest positions in the basis' interior embedding; empty without one.
  Points embedded(const std::vector<Index>& rows) const;
  /// Unit rest normals of samples; zero if the samples have no normals.
  Points normals(const std::vector<Index>& samples) const;
  /// Mean sample spacing: the square root of the area of a sample, in cube units.
  double spacing() const { return spacing_; }
  /// Samples near one at rest whose normals are on the same side; the sample itself is the first.
  const std::vector<Index>& neighbours(Index sample);
  /// The samples that have refined points, in the order of these points: says which points there are.
  const std::vector<Index>& refined() const { return refined_; }
  /// Adds refined points around samples that have none yet.
  void refine(const std::vector<Index>& samples);
  /// Gives these samples alone refined points; they were refined() before.
  void set_refined(const std::vector<Index>& samples);
  /// A hash of the rest positions of samples and vertices: equal for solvers on the same samples.
  std::uint64_t identity() const;

  /// Positions (size(),3) under the field with these coefficients; cached.
  const Points& at(const RowMatrix<double>& coefficients);
  /// Whether the cached positions are of these coefficients.
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
  std::vector<Index> parents_;  // the sample of each vertex and refined point
  Index coarse_ = 0;
  std::vector<Index> refined_;
  std::vector<Index> ends_;       // of the refined points of each of `refined_`
  std::vector<bool> is_fine_;     // whether a sample is one of `refined_`
  std::map<Index, Points> made_;  // refined points of each sample that ever had some
  Points rest_;
  Points embedded_;  // rest_ in the basis' interior embedding
  double spacing_ = 0.0;
  std::unique_ptr<PointGrid> grid_;       // of the samples
  std::vector<Index> cells_;              // the cell of each sample
  std::vector<std::vector<Index>> near_;  // cached neighbours of each sample
  Revision finer_places_ = 0;
  Dependent<RadialEvaluator<float>, 1> evaluator_;
  Dependent<RadialEvaluator<float>, 1> finer_;
  RowMatrix<double> coefficients_;  // of places_
  Points places_;
  Dependent<RadialEvaluator<float>, 1> slopes_;  // first derivatives at the samples
};

}  // namespace arapfields
