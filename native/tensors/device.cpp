// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include "core/errors.h"

namespace arapfields {

std::string resolve_device(const std::string& device) {
  if (device == "auto") return "cpu";  // CUDA is experimental: who wants it names it
  const bool cuda = has_cuda();
  require(device == "cpu" || device.rfind("cuda", 0) == 0, "device", "'" + device + "'",
          "'auto', 'cpu' or 'cuda' is allowed");
  require(device == "cpu" || cuda, "device", "'" + device + "'", device_report());
  return device;
}

}  // namespace arapfields
