// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "energies/contact.h"
#include "solve/radial/self_contact.h"

namespace arapfields {

/// The planes that places of a surface are kept beyond, until they are found anew.
struct ContactSet {
  std::vector<Index> rows;  ///< which of the places that are followed
  Points places;            ///< (n,3) theirs at rest
  std::vector<ContactPlane> planes;
  Revision revision = 0;   ///< 0: no planes
  double stiffness = 0.0;  ///< of energy a unit of area for a unit of squared depth, halved
};

/// The ways that places took, of each surface: `seen` and `anchors` go along with it.
struct ContactWays {
  std::vector<Points> seen;     ///< where places were last known outside
  std::vector<Points> anchors;  ///< where friction holds them
  RowMatrix<double> clear;      ///< (places, surfaces) no surface is nearer to where they were seen
  SelfContact::Ways own;
};

}  // namespace arapfields
