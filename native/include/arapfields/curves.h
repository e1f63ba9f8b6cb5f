// SPDX-License-Identifier: GPL-3.0-or-later
// Curves of the plane, deformed as surfaces are: sample_curve, deform_curve.
#pragma once

#include "energies/arap2d.h"
#include "sampling/curve_samples.h"
#include "solve/deform_curve.h"
