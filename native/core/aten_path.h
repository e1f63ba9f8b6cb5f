// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/export.h"

namespace at {
class Tensor;
}

namespace arapfields {

/// Whether a tensor is worked on by compositions of libtorch's operations rather than by our kernels: always
/// where it is not in main memory, and everywhere while an AtenPathScope lives.
bool on_aten_path(const at::Tensor& tensor);

/// Forces compositions on tensors in main memory too, in the whole process: what a device would compute can
/// then be compared with the kernels where there is none.
class ARAPFIELDS_EXPORT_TO_TESTS AtenPathScope {
 public:
  AtenPathScope();
  ~AtenPathScope();
  AtenPathScope(const AtenPathScope&) = delete;
  AtenPathScope& operator=(const AtenPathScope&) = delete;
};

}  // namespace arapfields
