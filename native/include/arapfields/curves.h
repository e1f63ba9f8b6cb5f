// SPDX-License-Identifier: GPL-3.0-or-later
// Curves of the plane, deformed as surfaces are: sample_curve, deform_curve.
#pragma once

#include "curve/deform_curve.h"
#include "energies/arap2d.h"
#include "sampling/curve_samples.h"
