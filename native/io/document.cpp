// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/document.h"

namespace arapfields {
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
