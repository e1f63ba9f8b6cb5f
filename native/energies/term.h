// SPDX-License-Identifier: GPL-3.0-or-later
// What an energy is to a solver.
#pragma once

#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "core/jets.h"
#include "optimize/iteration.h"

namespace arapfields {

class Tensor;
struct EnergyTables;
struct ComposedPart;

/// The samples of one evaluation of an objective, in cube coordinates.
struct TermBatch {
  Points points;            ///< (n,3) of the rest surface
  Points normals;           ///< (n,3) there; empty: not known
  Vector weights;           ///< (n) factors w on the energies; empty: all 1
  Vector bending;           ///< (n) λ
  std::vector<Index> rows;  ///< of the surface's samples that these are; −1: drawn anew. Empty: 0 … n−1
};

/// A term of an objective: a function of a field's jets at samples of the rest surface. It knows neither the
/// field nor the solver. set_batch() comes first; its data stay for any number of evaluations.
class ARAPFIELDS_EXPORT JetTerm {
 public:
  virtual ~JetTerm();
  /// Its name in callbacks and reports.
  virtual std::string name() const = 0;
  /// The lowest order of jets that it needs.
  virtual JetOrder order() const = 0;
  virtual void set_batch(const TermBatch& batch) = 0;
  /// The weighted value for jets at the batch's points, of order() or higher. Adds its cotangents (null data:
  /// the value alone), and appends its named parts, whose sum it is, unless `parts` is null.
  virtual double evaluate(const JetView<const float>& jets, const JetView<float>& cotangents,
                          std::vector<LossTerm>* parts) const = 0;
  virtual double evaluate(const JetView<const double>& jets, const JetView<double>& cotangents,
                          std::vector<LossTerm>* parts) const = 0;
  /// The same as a composition of tensor operations (composed_energies.h), for jets on a device; by default
  /// computed in main memory.
  virtual Tensor compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                         std::vector<ComposedPart>& parts) const;
};

using JetTerms = std::vector<std::shared_ptr<JetTerm>>;

/// The highest order among terms; values for none.
JetOrder highest_order(const JetTerms& terms);

/// A term times a factor.
std::shared_ptr<JetTerm> scaled(std::shared_ptr<JetTerm> term, double factor);

/// A term with one part. `Term` has
///   template <class Scalar>
///   double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const;
template <class Term>
class JetTermOf : public JetTerm {
 public:
  double evaluate(const JetView<const float>& jets, const JetView<float>& cotangents,
                  std::vector<LossTerm>* parts) const final {
    return listed<float>(jets, cotangents, parts);
  }
  double evaluate(const JetView<const double>& jets, const JetView<double>& cotangents,
                  std::vector<LossTerm>* parts) const final {
    return listed<double>(jets, cotangents, parts);
  }

 private:
  template <class Scalar>
  double listed(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents,
                std::vector<LossTerm>* parts) const {
    const double result = static_cast<const Term&>(*this).template value<Scalar>(jets, cotangents);
    if (parts != nullptr) parts->push_back({name(), result});
    return result;
  }
};

/// Numbers of a term in both precisions.
template <class Exact, class Single>
class InBothPrecisions {
 public:
  InBothPrecisions() = default;
  explicit InBothPrecisions(Exact exact) : exact_(std::move(exact)), single_(exact_.template cast<float>()) {}
  template <class Scalar>
  const auto& in() const {
    if constexpr (std::is_same_v<Scalar, float>)
      return single_;
    else
      return exact_;
  }

 private:
  Exact exact_;
  Single single_;
};
using PointsInBoth = InBothPrecisions<Points, PointsF>;
using VectorInBoth = InBothPrecisions<Vector, VectorF>;

}  // namespace arapfields
