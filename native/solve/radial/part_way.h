// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/state.h"

namespace arapfields {

/// Whether the solver's shape is that of a style at strength 1, of which its field shows a part of the way
/// from rest: a style alone moves it. Where handles, contact, a mass or further terms do too, strength is a
/// weight.
bool goes_part_way(const RadialState& state);

/// The coefficients of the field that is shown.
RowMatrix<double> shown_coefficients(const RadialState& state);

}  // namespace arapfields
