// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/task.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

/// Writes splats as a binary glTF file with one node of that name and the extension KHR_gaussian_splatting,
/// in whole or not at all. glTF's y is up: splats whose z is up are turned, with their colours; their own
/// axes are exchanged too, as Blender's importer does on the way back, so that it gives the same rotations
/// and scales. Throws InvalidInput for no splats and for more than the format has room for, FileError where
/// the system refuses, and Cancelled.
ARAPFIELDS_EXPORT void save_splats_gltf(const std::string& path, const GaussianSplats& splats,
                                        const std::string& name, bool z_up = false,
                                        const Progress& progress = {});

}  // namespace arapfields
