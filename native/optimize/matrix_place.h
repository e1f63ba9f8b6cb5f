// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// A weight matrix within a vector of parameters, row by row, that an optimizer may treat as a matrix.
struct MatrixPlace {
  Index begin = 0, rows = 0, columns = 0;

  Index end() const { return begin + rows * columns; }
};

}  // namespace arapfields
