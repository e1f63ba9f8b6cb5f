// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/field.h"

#include <ATen/ATen.h>

#include "core/device.h"
#include "core/parallel.h"

namespace arapfields {

at::Tensor DeformationField::jets(const at::Tensor& points, JetOrder order) const {
  const ThreadScope scope;
  const at::Tensor host = points.to(at::kCPU, at::kDouble).contiguous();
  JetBlock<double> block(host.size(0), order);
  evaluate(Eigen::Map<const Points>(host.const_data_ptr<double>(), host.size(0), 3), block.view());
  const at::Tensor jets = at::from_blob(block.view().data, {columns(order), host.size(0), 3}, at::kDouble);
  return upload(jets.to(points.scalar_type()), points);
}

}  // namespace arapfields
