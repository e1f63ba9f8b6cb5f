// SPDX-License-Identifier: GPL-3.0-or-later
// Terms of a RadialObjective: their data and their values.
#pragma once

#include <optional>
#include <vector>

#include "energies/arap.h"
#include "energies/body.h"
#include "energies/stance.h"
#include "energies/style.h"

namespace arapfields {

struct StyleRequest {
  Style style;
  double strength;
  double sharpness;  ///< 0: the style's own
  Vector weights;    ///< of all samples; empty: all 1
  Vec3 up;           ///< the figure's upward direction
};

template <class Scalar>
struct StyleTerm {
  std::optional<GaussPreference> preference;  ///< none: targets
  PointsOf<Scalar> normals;                   ///< (n,3) at rest
  PointsOf<Scalar> targets;                   ///< (n,3) T(n) of an object's style, or empty
  Eigen::VectorX<Scalar> weights;             ///< (n)
  double weight = 1.0;                        ///< λ_Gauss

  /// Whether the rest normals minimise the style's energy already.
  bool idle() const { return StyleAtSamples{preference, targets, weights}.idle(normals); }
  template <class Other>
  StyleTerm<Other> cast() const {
    return {preference, normals.template cast<Other>(), targets.template cast<Other>(),
            weights.template cast<Other>(), weight};
  }
};

template <class Scalar>
struct StanceTerm {
  Stance stance;
  PointsOf<Scalar> rest;  ///< (n,3) samples
  double weight = 0.0;

  template <class Other>
  StanceTerm<Other> cast() const {
    return {stance, rest.template cast<Other>(), weight};
  }
};

struct RadialTerms {
  ArapValue arap;
  double handles = 0.0;          ///< mean squared distance to the targets
  double gauss = 0.0;            ///< style_energy(), where there is a style
  double barrier = 0.0;          ///< energies/distortion.h
  double stance = 0.0;           ///< energies/stance.h
  BodyEnergy body;               ///< energies/body.h, weighted
  double contact = 0.0;          ///< energies/contact.h
  std::vector<double> external;  ///< weighted
};

}  // namespace arapfields
