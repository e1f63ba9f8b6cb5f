// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Rows (n,3) of unit length; zeros stay.
template <class Rows>
Points unit_rows(const Eigen::MatrixBase<Rows>& rows) {
  Points result = rows.rowwise().normalized();
  for (Index i = 0; i < rows.rows(); ++i)
    if (rows.row(i).isZero(0.0)) result.row(i).setZero();
  return result;
}

}  // namespace arapfields
