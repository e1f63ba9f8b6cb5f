// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "core/errors.h"
#include "core/frame.h"
#include "core/types.h"
#include "io/archive.h"

// The metadata that files of every kind share: format, version, kind, structure and report, as texts.

namespace arapfields {

using Json = nlohmann::json;

/// Parses JSON of an untrusted file. Throws InvalidInput naming `what` for invalid JSON, objects with two
/// members of one name, and nesting deeper than 32.
Json parse_json(const std::string& text, const std::string& what);

/// One object of such JSON. Throws InvalidInput naming the member for what is missing, of another type, out
/// of range, or not among `known`.
class JsonObject {
 public:
  JsonObject(const Json& value, std::string name, std::initializer_list<const char*> known);

  bool has(const char* member) const { return value_.contains(member); }
  std::string text(const char* member) const;
  double number(const char* member) const;  ///< finite
  Index integer(const char* member, Index low, Index high) const;
  Vec3 triple(const char* member) const;
  const Json& at(const char* member) const;
  std::string name(const char* member) const { return name_ + "." + member; }

 private:
  const Json& value_;
  std::string name_;
};

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
