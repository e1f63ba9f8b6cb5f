// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/point_grid.h"
#include "fields/radial_evaluator.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// The places of a surface that are followed: samples, vertices of its mesh that stand out of them, and finer
/// places around samples that meet an edge, which would poke through between them.
class ContactPoints {
 public:
  explicit ContactPoints(const RadialProblem& problem) : problem_(problem) {}
  /// Takes the places of the rest shape, once. Throws Cancelled.
  void choose(const Progress& progress = {});
  bool empty() const { return samples_.empty(); }
  /// Rows of the problem's samples that are followed.
  const std::vector<Index>& samples() const { return samples_; }
  /// Of samples, vertices and finer places, in this order.
  Index size() const { return rest_.rows(); }
  Index sample_count() const { return static_cast<Index>(samples_.size()); }
  /// All but finer places.
  Index coarse_count() const { return coarse_; }
  /// The sample that a place belongs to.
  Index sample_of(Index row) const;
  /// The area that a place stands for, as a share of the whole.
  double share(Index row) const;
  Points rest(const std::vector<Index>& rows) const;
  /// The same in the basis' embedding; empty without one.
  Points embedded(const std::vector<Index>& rows) const;
  /// Of samples, as they face at rest; zero where that is not known.
  Points normals(const std::vector<Index>& samples) const;
  /// About the distance of a sample to what it stands for.
  double spacing() const { return spacing_; }
  /// Samples near one at rest, on the same side.
  const std::vector<Index>& neighbours(Index sample);
  /// Adds finer places around samples that have none yet.
  void refine(const std::vector<Index>& samples);
  /// No finer places.
  void coarsen();

  const Points& at(const RowMatrix<double>& coefficients);
  /// Whether these were the last ones.
  bool is_at(const RowMatrix<double>& coefficients) const {
    return coefficients.rows() == coefficients_.rows() && coefficients == coefficients_;
  }
  /// Which way the samples face, as long as the surface is stretched; zero outside of these blocks, if
  /// not null.
  Points normals_at(const RowMatrix<double>& coefficients, const std::vector<Index>* blocks = nullptr);

 private:
  Points finer(Index sample);
  Points embedded_at(PointsIn places) const;

  const RadialProblem& problem_;
  std::vector<Index> samples_;
  std::vector<Index> parents_;  // of what is no sample
  Index coarse_ = 0;
  std::vector<bool> is_fine_;  // samples
  Points rest_;
  Points embedded_;  // rest_
  double spacing_ = 0.0;
  std::unique_ptr<PointGrid> grid_;  // of the samples
  std::vector<Index> cells_;         // of each
  std::vector<std::vector<Index>> near_;
  Revision finer_places_ = 0;
  Dependent<RadialEvaluator<float>, 1> evaluator_;
  Dependent<RadialEvaluator<float>, 1> finer_;
  RowMatrix<double> coefficients_;  // of the places that were asked for last
  Points places_;
  Dependent<RadialEvaluator<float>, 1> slopes_;  // of the samples
};

}  // namespace arapfields
