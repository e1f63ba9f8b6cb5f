// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include <charconv>

#include "core/errors.h"

namespace arapfields {
namespace {

/// The number in "cuda" (0) and "cuda:N"; -1 for another name.
int cuda_number(const std::string& device) {
  if (device == "cuda") return 0;
  if (!device.starts_with("cuda:")) return -1;
  const char *first = device.data() + 5, *last = device.data() + device.size();
  int number = -1;
  const auto [end, failure] = std::from_chars(first, last, number);
  return failure == std::errc() && end == last ? number : -1;
}

}  // namespace

std::string resolve_device(const std::string& device) {
  if (device == "auto" || device == "cpu") return "cpu";
  const int number = cuda_number(device), count = cuda_devices();
  require(number >= 0, "device", "'" + device + "'", "'auto', 'cpu', 'cuda' or 'cuda:N' is allowed");
  require(count > 0, "device", "'" + device + "'", device_report());
  require(number < count, "device", "'" + device + "'",
          "the last CUDA device is 'cuda:" + std::to_string(count - 1) + "'");
  return device;
}

}  // namespace arapfields
