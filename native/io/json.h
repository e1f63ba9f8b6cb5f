// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "core/types.h"

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

}  // namespace arapfields
