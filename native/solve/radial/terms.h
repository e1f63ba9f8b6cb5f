// SPDX-License-Identifier: GPL-3.0-or-later
// What joins the energy of a live solve, at its samples.
#pragma once

#include <vector>

#include "energies/arap.h"
#include "energies/body.h"
#include "energies/stance.h"
#include "energies/style.h"

namespace arapfields {

/// A style's preference at the samples of a live solve.
struct RadialStyle {
  StyleAtSamples style;
  Points normals;       ///< (n,3) rest normals of the samples
  double weight = 1.0;  ///< λ_Gauss
};

/// What RadialSolver::set_style was called with.
struct StyleAsked {
  Style style;
  double strength, sharpness;
  Vector weights;
  Vec3 up;
};

/// What keeps a figure's stance at the samples of a live solve.
struct RadialStance {
  Stance stance;
  Points rest;  ///< (n,3) samples
  double weight = 0.0;
};

/// What the terms of the energy come to.
struct RadialTerms {
  ArapValue arap;
  double handles = 0.0;          ///< mean squared distance to the targets
  double gauss = 0.0;            ///< style_energy(), where there is a style
  double barrier = 0.0;          ///< energies/distortion.h
  double stance = 0.0;           ///< energies/stance.h
  BodyEnergy body;               ///< energies/body.h, weighted
  std::vector<double> external;  ///< weighted
};

}  // namespace arapfields
