// SPDX-License-Identifier: GPL-3.0-or-later
// Stretch and bend, distortion, preferred normals, of the jets of any field.
#pragma once

#include "energies/arap.h"
#include "energies/distortion.h"
#include "energies/external_energy.h"
#include "energies/gauss.h"
#include "energies/object_style.h"
#include "energies/rotation.h"
#include "energies/styles.h"
#include "solve/field_measures.h"
