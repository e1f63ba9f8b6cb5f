// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"

namespace arapfields {

class JetTerm;

/// External forces on a body of mass m, at samples (n): the inertia of an implicit time step, and gravity.
template <class Scalar>
struct Body {
  Eigen::VectorX<Scalar> masses;  ///< (n) none negative
  PointsOf<Scalar> rest;          ///< (n,3) where the potential of gravity is 0
  PointsOf<Scalar> goal;          ///< (n,3) positions that free motion would reach
  double inertia = 0.0;           ///< weight of the squared distance from there; 0: none
  Vec3 gravity = Vec3::Zero();    ///< force on a unit of mass
};

struct BodyEnergy {
  double inertia = 0.0;  ///< ½ inertia · mean m ‖f − goal‖²
  double weight = 0.0;   ///< −mean m gravity·(f − rest)
  double sum() const { return inertia + weight; }
};

/// For jets of f at the samples; adds the cotangents of the sum on the value column (data may be null).
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS BodyEnergy body_energy(JetView<const Scalar> jets, const Body<Scalar>& body,
                                                  JetView<Scalar> cotangents);

/// The sum of body_energy(), of a body at the samples of all batches.
std::shared_ptr<JetTerm> body_term(const Body<double>& body);

}  // namespace arapfields
