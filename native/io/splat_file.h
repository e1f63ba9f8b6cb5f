// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/task.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

/// Splats of a binary PLY file with the properties x, y, z, f_dc_*, f_rest_*, opacity, scale_* and rot_*.
/// Other properties are kept. Throws FileError where the file cannot be read, InvalidInput that begins with
/// its name where it is damaged or has another layout, and Cancelled.
ARAPFIELDS_EXPORT GaussianSplats load_splats(const std::string& path, const Progress& progress = {});
/// Writes such a file, in whole or not at all.
ARAPFIELDS_EXPORT void save_splats(const std::string& path, const GaussianSplats& splats,
                                   const Progress& progress = {});
/// Whether a file begins as a PLY file of splats does; false where it cannot be read.
ARAPFIELDS_EXPORT bool is_splat_file(const std::string& path);

}  // namespace arapfields
