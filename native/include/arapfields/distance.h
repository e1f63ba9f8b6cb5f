// SPDX-License-Identifier: GPL-3.0-or-later
// Exact signed distances and winding numbers of triangle soups: SignedDistance, signed_distance.
#pragma once

#include "distance/signed_distance.h"
