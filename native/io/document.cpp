// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/document.h"

#include <algorithm>
#include <set>
#include <vector>

#include "core/errors.h"

namespace arapfields {
namespace {

constexpr int most_nesting = 32;

std::string quoted(const std::string& name) { return std::string(1, '\'').append(name).append(1, '\''); }

/// Finite: JSON has no other numbers, and those beyond a double's range are no JSON to the parser.
double number_of(const Json& value, const std::string& name) {
  require(value.is_number(), name, std::string("a ") + value.type_name(), "a number is needed");
  return value.get<double>();
}

}  // namespace

Json parse_json(const std::string& text, const std::string& what) {
  std::vector<std::set<std::string>> members;
  const auto watch = [&](int depth, Json::parse_event_t event, Json& value) {
    require(depth <= most_nesting, what, "nested deeper than " + std::to_string(most_nesting),
            "files that save writes are not");
    if (event == Json::parse_event_t::object_start) members.emplace_back();
    if (event == Json::parse_event_t::object_end) members.pop_back();
    if (event == Json::parse_event_t::key)
      require(members.back().insert(value.get<std::string>()).second, what,
              quoted(value.get<std::string>()).append(" stands there twice"), "once is allowed");
    return true;
  };
  try {
    return Json::parse(text, watch);
  } catch (const Json::exception& error) {
    throw InvalidInput(what, "not JSON", error.what());
  }
}

JsonObject::JsonObject(const Json& value, std::string name, std::initializer_list<const char*> known)
    : value_(value), name_(std::move(name)) {
  require(value.is_object(), name_, std::string("a ") + value.type_name(), "an object is needed");
  for (const auto& member : value.items())
    require(std::any_of(known.begin(), known.end(), [&](const char* k) { return member.key() == k; }), name_,
            "unknown member " + quoted(member.key()), "this release does not know it");
}

const Json& JsonObject::at(const char* member) const {
  require(has(member), name_, quoted(member).append(" is missing"), "it is needed");
  return value_[member];
}

std::string JsonObject::text(const char* member) const {
  const Json& value = at(member);
  require(value.is_string(), name(member), std::string("a ") + value.type_name(), "a text is needed");
  return value.get<std::string>();
}

double JsonObject::number(const char* member) const { return number_of(at(member), name(member)); }

Index JsonObject::integer(const char* member, Index low, Index high) const {
  const double value = number(member);
  require(at(member).is_number_integer() && value >= static_cast<double>(low) &&
              value <= static_cast<double>(high),
          name(member), at(member).dump(),
          "an integer from " + std::to_string(low) + " to " + std::to_string(high) + " is needed");
  return at(member).get<Index>();
}

Vec3 JsonObject::triple(const char* member) const {
  const Json& value = at(member);
  require(value.is_array() && value.size() == 3, name(member), "not a list of three",
          "three numbers are needed");
  Vec3 result;
  for (int k = 0; k < 3; ++k) result[k] = number_of(value[k], name(member));
  return result;
}

namespace {

constexpr const char* format_name = "arapfields";

void check_version(const std::string& text) {
  const bool number = !text.empty() && text.size() < 6 && text.find_first_not_of("0123456789") == text.npos;
  const int version = number ? std::stoi(text) : 0;
  require(version >= 1, "version", "'" + text + "'", "versions are numbers from 1 on");
  require(version <= file_version, "version", text + ": a newer release wrote this file",
          "this one reads versions up to " + std::to_string(file_version));
}

/// The report's text, seen to be a JSON object.
const std::string& checked_report(const std::string& text) {
  require(parse_json(text, "report").is_object(), "report", "not an object", "a JSON object is needed");
  return text;
}

}  // namespace

void save_document(const std::string& path, const std::string& kind, const Json& structure,
                   const std::string& report, const ArchiveWriter& arrays) {
  arrays.save(path, {{"format", format_name},
                     {"version", std::to_string(file_version)},
                     {"kind", kind},
                     {"structure", structure.dump()},
                     {"report", checked_report(report)}});
}

void load_document(const std::string& path, const std::string& kind, std::string* report,
                   const std::function<void(ArchiveReader&, int version, const Json&)>& read) {
  try {
    ArchiveReader file(path);
    require(file.text("format") == format_name, "format", "'" + file.text("format") + "'",
            std::string("'") + format_name + "' is needed");
    check_version(file.text("version"));
    require(file.text("version") == "1" || file.has_checksum(), checksum_name, "it is missing",
            "files from version 2 on have one");
    require(file.text("kind") == kind, "kind", "it holds '" + file.text("kind") + "'",
            "'" + kind + "' is needed");
    const std::string& measured = checked_report(file.text("report"));
    read(file, std::stoi(file.text("version")), parse_json(file.text("structure"), "structure"));
    file.require_all_used();
    if (report != nullptr) *report = measured;
  } catch (const InvalidInput& error) {
    throw InvalidInput(path + ": cannot be loaded; " + error.what());
  }
}

Json frame_structure(const Frame& frame) {
  return {{"center", {frame.center.x(), frame.center.y(), frame.center.z()}}, {"scale", frame.scale}};
}

Frame read_frame(const Json& frame, const std::string& name) {
  const JsonObject object(frame, name, {"center", "scale"});
  const Frame result{object.triple("center"), object.number("scale")};
  require_positive(object.name("scale"), result.scale);
  return result;
}

}  // namespace arapfields
