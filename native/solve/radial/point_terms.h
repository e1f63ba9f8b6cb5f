// SPDX-License-Identifier: GPL-3.0-or-later
// Terms of a RadialObjective with points of their own: each owns a segment of the measurements.
#pragma once

#include <functional>
#include <string>

#include "core/tall_product.h"
#include "energies/handles.h"
#include "fields/radial_evaluator.h"
#include "solve/radial/part_links.h"

namespace arapfields {

/// Jets (columns·n, 3) of some field at points (n,3) of the solver's cube.
using JetsAt = std::function<RowMatrix<double>(const Points& points, JetOrder order)>;

/// A term of the values at its own points. A segment has rows() rows of three numbers.
template <class Scalar>
class PointTerm {
 public:
  virtual ~PointTerm() = default;
  virtual Index rows() const = 0;
  /// The segment of the field with these coefficients, which are also given in the solver's precision.
  virtual void measure(const RowMatrix<double>& c, const PointsOf<Scalar>& rounded, Scalar* u) const = 0;
  /// The segment (rows(), 3) of any field.
  virtual RowMatrix<double> measure_field(const JetsAt& jets_at) const = 0;
  /// The weighted value; writes its cotangents (null: the value alone), which are zero before.
  virtual double value(const Scalar* u, Scalar* cotangents) const = 0;
  /// Adds the pull-back of cotangents to a gradient (size, 3).
  virtual void pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const = 0;
  /// The Hessian, with respect to the segment, of the term's part in the quadratic model, times u; `out` is
  /// zero before.
  virtual void model(const Scalar* u, Scalar* out) const = 0;
};

/// weight · mean over handles of the mean squared distance to the targets.
template <class Scalar>
class HandleTerm final : public PointTerm<Scalar> {
 public:
  HandleTerm() = default;
  /// Pairs, and the basis functions' values (pairs, size) at their sources.
  HandleTerm(const HandleBatch<double>& pairs, const RowMatrix<double>& basis_values, double weight);
  void set_targets(PointsIn targets);
  double weight() const { return weight_; }

  Index rows() const override { return pairs_.sources.rows(); }
  void measure(const RowMatrix<double>& c, const PointsOf<Scalar>& rounded, Scalar* u) const override;
  RowMatrix<double> measure_field(const JetsAt& jets_at) const override {
    return jets_at(sources_, JetOrder::value);
  }
  double value(const Scalar* u, Scalar* cotangents) const override;
  void pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const override;
  void model(const Scalar* u, Scalar* out) const override;

 private:
  Points sources_ = Points(0, 3);
  HandleBatch<Scalar> pairs_;
  TallMatrix<Scalar> basis_values_;  // (pairs, size)
  double weight_ = 0.0;
};

/// The links of parts without pairs (part_links.h): the sum of the squared residuals.
template <class Scalar>
class LinkTerm final : public PointTerm<Scalar> {
 public:
  LinkTerm() = default;
  explicit LinkTerm(const PartLinks& links) : links_(links), basis_values_(links.rows()) {}

  Index rows() const override { return basis_values_.rows(); }
  void measure(const RowMatrix<double>& c, const PointsOf<Scalar>& rounded, Scalar* u) const override;
  RowMatrix<double> measure_field(const JetsAt& jets_at) const override {
    return links_.values(jets_at(links_.from(), JetOrder::first), jets_at(links_.to(), JetOrder::first));
  }
  double value(const Scalar* u, Scalar* cotangents) const override;
  void pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const override;
  void model(const Scalar* u, Scalar* out) const override;

 private:
  PartLinks links_;
  TallMatrix<Scalar> basis_values_;  // (rows, size)
};

/// A tiny ridge on the centers' coefficients: removes components that vanish at all samples.
template <class Scalar>
class RidgeTerm final : public PointTerm<Scalar> {
 public:
  RidgeTerm() = default;
  explicit RidgeTerm(Index centers) : centers_(centers) {}

  Index rows() const override { return centers_; }
  void measure(const RowMatrix<double>& c, const PointsOf<Scalar>& rounded, Scalar* u) const override;
  RowMatrix<double> measure_field(const JetsAt&) const override {
    return RowMatrix<double>::Zero(centers_, 3);
  }
  double value(const Scalar* u, Scalar* cotangents) const override;
  void pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const override;
  void model(const Scalar*, Scalar*) const override {}

 private:
  Index centers_ = 0;
};

}  // namespace arapfields
