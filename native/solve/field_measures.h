// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/arap.h"
#include "energies/distortion.h"
#include "fields/field.h"

namespace arapfields {

struct FieldMeasures {
  ArapValue arap;  ///< in the field's unit cube
  Distortion distortion;
};

/// How rigid a field is at points (n,3) of the rest surface, in mesh coordinates: means and extremes over
/// them. Throws InvalidInput for no points and for NaN or infinity among them.
ARAPFIELDS_EXPORT FieldMeasures measure_at(const DeformationField& field, PointsIn points);

}  // namespace arapfields
