// SPDX-License-Identifier: GPL-3.0-or-later
// Deformations with their derivatives, and their inverses: DeformationField, RadialField,
// ComposedField, invert; apply_field.
#pragma once

#include "core/jets.h"
#include "fields/apply_field.h"
#include "fields/composed_field.h"
#include "fields/field.h"
#include "fields/inverse.h"
#include "fields/radial_field.h"
