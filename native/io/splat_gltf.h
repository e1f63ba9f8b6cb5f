// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/task.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

/// Writes splats as a binary glTF file with one node of that name and the extension KHR_gaussian_splatting,
/// in whole or not at all. Coordinates are written as they are; glTF's y is up. Throws InvalidInput for no
/// splats and for more than the format has room for, FileError where the system refuses, and Cancelled.
ARAPFIELDS_EXPORT void save_splats_gltf(const std::string& path, const GaussianSplats& splats,
                                        const std::string& name, const Progress& progress = {});

}  // namespace arapfields
