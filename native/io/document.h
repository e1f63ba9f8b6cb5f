// SPDX-License-Identifier: GPL-3.0-or-later
// The metadata that files of every kind share: format, version, kind, structure and report, as texts.
#pragma once

#include <functional>
#include <string>

#include "core/errors.h"
#include "core/frame.h"
#include "io/archive.h"
#include "io/json.h"

namespace arapfields {

/// The version that is written. One that changes what a file holds gets the next number, and load_document's
/// callers keep a reader for each number before.
inline constexpr int file_version = 3;  // 2: with a checksum; 3: what an embedding's nodes see of each other

/// Writes arrays with their metadata.
void save_document(const std::string& path, const std::string& kind, const Json& structure,
                   const std::string& report, const ArchiveWriter& arrays);

/// Opens a file of this kind, passes its arrays, version and structure to `read`, and checks that all of it
/// was read. Every InvalidInput begins with the path.
void load_document(const std::string& path, const std::string& kind, std::string* report,
                   const std::function<void(ArchiveReader&, int version, const Json&)>& read);

Json frame_structure(const Frame& frame);
Frame read_frame(const Json& frame, const std::string& name);

}  // namespace arapfields
