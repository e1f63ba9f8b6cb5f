// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/field.h"

#include "core/parallel.h"
#include "tensors/views.h"

namespace arapfields {

Tensor DeformationField::jets(const Tensor& points, JetOrder order) const {
  const ThreadScope scope;
  const Points host = points_of(points);
  JetBlock<double> block(host.rows(), order);
  evaluate(host, block.view());
  return tensor_like(block.view(), points);
}

}  // namespace arapfields
