// SPDX-License-Identifier: GPL-3.0-or-later
// Fields and signed distances as files. Each is one file in the layout of safetensors (io/document.h),
// written whole or not at all (io/output_file.h); nothing in a file is ever executed. What a file says of
// itself is checked before memory is asked for, and what this release does not know is refused.
#pragma once

#include <memory>
#include <string>

#include "core/export.h"
#include "fields/field.h"
#include "neural/neural_sdf.h"

namespace arapfields {

/// Writes a field of a kind that has a format (neural and radial ones) with a report, a JSON object:
/// the measurements of its solve. Throws InvalidInput for other kinds and
/// reports, FileError where the system refuses, and then nothing has changed.
ARAPFIELDS_EXPORT void save_field(const std::string& path, const DeformationField& field,
                                  const std::string& report = "{}");
/// The field of such a file; `report`, where it is not null, receives its report. Throws FileError for what
/// cannot be read, and InvalidInput that begins with the file's name for what is damaged, foreign, of another
/// kind, of a newer version, or does not fit together.
ARAPFIELDS_EXPORT std::shared_ptr<DeformationField> load_field(const std::string& path,
                                                               std::string* report = nullptr);

/// The same for a network's signed distance.
ARAPFIELDS_EXPORT void save_sdf(const std::string& path, const NeuralSdf& sdf,
                                const std::string& report = "{}");
ARAPFIELDS_EXPORT std::shared_ptr<NeuralSdf> load_sdf(const std::string& path, std::string* report = nullptr);

}  // namespace arapfields
