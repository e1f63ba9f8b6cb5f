// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/document.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <set>
#include <vector>

#include "core/errors.h"
#include "core/memory.h"
#include "io/output_file.h"

namespace arapfields {
namespace {

static_assert(std::endian::native == std::endian::little, "files are little-endian, and copied as they are");

constexpr const char* texts_key = "__metadata__";
constexpr std::size_t most_header = std::size_t{64} << 20;
constexpr Index most_dimensions = 8;
constexpr Index most_bytes = Index{1} << 48;  ///< of one array; products of sizes stay far from overflow

constexpr std::size_t digits = 16;  ///< of a checksum
constexpr std::size_t read_at_once = std::size_t{1} << 20;

/// FNV-1a over words of 32 bits, of which all parts of a file are made: each word is taken in by a one-to-one
/// map, so that no change of a single one goes unseen.
class Checksum {
 public:
  void add(const void* data, std::size_t bytes) {
    for (std::size_t at = 0; at < bytes; at += sizeof(std::uint32_t)) {
      std::uint32_t word = 0;
      std::memcpy(&word, static_cast<const char*>(data) + at, std::min(sizeof word, bytes - at));
      state_ = (state_ ^ word) * 0x100000001b3u;
    }
  }
  std::string text() const {
    char result[digits + 1];
    std::snprintf(result, sizeof result, "%016llx", static_cast<unsigned long long>(state_));
    return result;
  }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325u;
};

/// Where the checksum stands in a header.
std::size_t checksum_place(const std::string& header) {
  const std::string before = std::string("\"") + checksum_name + "\":\"";
  const std::size_t at = header.find(before);
  return at == header.npos ? at : at + before.size();
}

std::string shape_text(const std::vector<Index>& shape) {
  std::string text;
  for (const Index size : shape) text += (text.empty() ? "" : ", ") + std::to_string(size);
  return "(" + text + ")";
}

std::string array_name(const std::string& name) { return "array '" + name + "'"; }

/// Bytes of an array; InvalidInput where they are more than any file has.
std::size_t bytes_of(const std::string& name, const std::vector<Index>& shape, Index item) {
  Index bytes = item;
  for (const Index size : shape) {
    require(size == 0 || bytes <= most_bytes / size, name, "shape " + shape_text(shape), "it is too large");
    bytes *= size;
  }
  return static_cast<std::size_t>(bytes);
}

}  // namespace

void ArchiveWriter::add(const std::string& name, const std::vector<Index>& shape, const double* data) {
  entries_.push_back({name, true, shape, data, bytes_of(name, shape, sizeof(double))});
}

void ArchiveWriter::add(const std::string& name, const std::vector<Index>& shape, const float* data) {
  entries_.push_back({name, false, shape, data, bytes_of(name, shape, sizeof(float))});
}

void ArchiveWriter::save(const std::string& path, const std::map<std::string, std::string>& texts) const {
  std::vector<Entry> ordered = entries_;  // doubles first: all arrays are aligned
  std::stable_partition(ordered.begin(), ordered.end(), [](const Entry& e) { return e.is_double; });
  Json header = {{texts_key, texts}};
  header[texts_key][checksum_name] = std::string(digits, '0');
  std::size_t offset = 0;
  for (const Entry& entry : ordered) {
    header[entry.name] = {{"dtype", entry.is_double ? "F64" : "F32"},
                          {"shape", entry.shape},
                          {"data_offsets", {offset, offset + entry.bytes}}};
    offset += entry.bytes;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');
  require(text.size() <= most_header, path, "a header of " + std::to_string(text.size()) + " bytes",
          "at most " + std::to_string(most_header) + " are allowed");
  const std::uint64_t length = text.size();
  Checksum sum;
  sum.add(text.data(), text.size());
  for (const Entry& entry : ordered) sum.add(entry.data, entry.bytes);
  text.replace(checksum_place(text), digits, sum.text());
  OutputFile file(path);
  file.write(&length, sizeof length);
  file.write(text.data(), text.size());
  for (const Entry& entry : ordered) file.write(entry.data, entry.bytes);
  file.commit();
}

ArchiveReader::ArchiveReader(const std::string& path) : file_(path) {
  std::uint64_t length = 0;
  require(file_.size() > sizeof length, "header", "there are " + std::to_string(file_.size()) + " bytes",
          "a file that save wrote is needed");
  file_.read(0, &length, sizeof length);
  require(length <= std::min(most_header, file_.size() - sizeof length), "header",
          "a length of " + std::to_string(length),
          "more than the file has, or no file that save wrote, or it is cut off");
  std::string text(length, '\0');
  file_.read(sizeof length, text.data(), length);
  require(!text.empty() && text.front() == '{', "header", "does not begin with an object",
          "a file that save wrote is needed");
  const Json header = parse_json(text, "header");
  data_ = sizeof length + length;
  require(header.contains(texts_key), "header", "'__metadata__' is missing",
          "a file that save wrote is needed");
  for (const auto& [name, value] : header.items()) {
    if (name != texts_key) {
      read_entry(name, JsonObject(value, array_name(name), {"dtype", "shape", "data_offsets"}));
      continue;
    }
    require(value.is_object(), texts_key, std::string("a ") + value.type_name(), "an object is needed");
    for (const auto& [key, entry] : value.items()) {
      require(entry.is_string(), key, std::string("a ") + entry.type_name(), "a text is needed");
      texts_[key] = entry.get<std::string>();
    }
  }
  require_no_gaps(data_);
  if (has_checksum()) compare_checksum(std::move(text));
}

void ArchiveReader::compare_checksum(std::string header) const {
  const std::string& told = texts_.at(checksum_name);
  const std::size_t place = checksum_place(header);
  const bool stands = place != header.npos && header.compare(place, told.size() + 1, told + '"') == 0;
  require(stands && told.size() == digits, checksum_name, "'" + told + "'", "sixteen digits are needed");
  header.replace(place, digits, digits, '0');
  Checksum sum;
  sum.add(header.data(), header.size());
  std::string part(read_at_once, '\0');
  for (std::size_t at = data_; at < file_.size(); at += part.size()) {
    part.resize(std::min(read_at_once, file_.size() - at));
    file_.read(at, part.data(), part.size());
    sum.add(part.data(), part.size());
  }
  require(sum.text() == told, "file", "its content does not fit its checksum", "it has been damaged");
}

void ArchiveReader::read_entry(const std::string& name, const JsonObject& value) {
  const auto list = [&](const char* member, std::size_t least, std::size_t most) {
    const Json& items = value.at(member);
    require(items.is_array() && items.size() >= least && items.size() <= most, value.name(member),
            items.is_array() ? std::to_string(items.size()) + " of them" : "no list",
            "a short list is needed");
    std::vector<Index> result;
    for (const Json& item : items) {
      require(item.is_number_unsigned() && item.get<std::uint64_t>() <= most_bytes, value.name(member),
              item.dump(), "sizes are integers from 0 to " + std::to_string(most_bytes));
      result.push_back(item.get<Index>());
    }
    return result;
  };
  Entry entry{value.text("dtype"), list("shape", 0, most_dimensions), 0, 0};
  require(entry.dtype == "F64" || entry.dtype == "F32", value.name("dtype"), "'" + entry.dtype + "'",
          "'F64' or 'F32' is needed");
  const std::vector<Index> offsets = list("data_offsets", 2, 2);
  const std::size_t bytes =
      bytes_of(array_name(name), entry.shape, entry.dtype == "F64" ? sizeof(double) : sizeof(float));
  const std::size_t available = file_.size() - data_;
  entry.begin = static_cast<std::size_t>(offsets[0]);
  entry.end = static_cast<std::size_t>(offsets[1]);
  require(entry.begin <= entry.end && entry.end <= available, value.name("data_offsets"), shape_text(offsets),
          "the file has " + std::to_string(available) + " bytes of arrays: is it cut off?");
  require(entry.end - entry.begin == bytes, array_name(name),
          std::to_string(entry.end - entry.begin) + " bytes",
          "shape " + shape_text(entry.shape) + " of " + entry.dtype + " takes " + std::to_string(bytes));
  entry.begin += data_, entry.end += data_;
  entries_[name] = std::move(entry);
}

void ArchiveReader::require_no_gaps(std::size_t begin) const {
  std::vector<std::pair<std::size_t, std::size_t>> parts;
  for (const auto& [name, entry] : entries_) parts.emplace_back(entry.begin, entry.end);
  std::sort(parts.begin(), parts.end());
  for (const auto& [first, last] : parts) {
    require(first == begin, "data_offsets", "arrays overlap or leave a gap", "each follows the one before");
    begin = last;
  }
  require(begin == file_.size(), "file", std::to_string(file_.size() - begin) + " bytes belong to no array",
          "a file that save wrote is needed");
}

const std::string& ArchiveReader::text(const std::string& name) {
  const auto entry_of_name = texts_.find(name);
  require(entry_of_name != texts_.end(), texts_key, "'" + name + "' is missing",
          "a file that save wrote is needed");
  used_.insert(texts_key + name);
  return entry_of_name->second;
}

template <class Result>
Result ArchiveReader::array(const std::string& name, const std::vector<Index>& shape, const char* dtype) {
  const auto entry_of_name = entries_.find(name);
  require(entry_of_name != entries_.end(), array_name(name), "is missing",
          "a file that save wrote is needed");
  const Entry& entry = entry_of_name->second;
  require(entry.dtype == dtype, array_name(name), "dtype " + entry.dtype, std::string(dtype) + " is needed");
  require(entry.shape == shape, array_name(name), "shape " + shape_text(entry.shape),
          "what is declared needs " + shape_text(shape));
  require_memory(array_name(name), static_cast<double>(entry.end - entry.begin));
  Result result(static_cast<Index>((entry.end - entry.begin) / sizeof(typename Result::Scalar)));
  file_.read(entry.begin, result.data(), entry.end - entry.begin);
  require(result.allFinite(), array_name(name), "holds NaN or infinite numbers", "all must be finite");
  used_.insert(name);
  return result;
}

Vector ArchiveReader::doubles(const std::string& name, const std::vector<Index>& shape) {
  return array<Vector>(name, shape, "F64");
}

VectorF ArchiveReader::floats(const std::string& name, const std::vector<Index>& shape) {
  return array<VectorF>(name, shape, "F32");
}

Points ArchiveReader::points(const std::string& name, Index count) {
  const Vector flat = doubles(name, {count, 3});
  return Eigen::Map<const Points>(flat.data(), count, 3);
}

void ArchiveReader::require_all_used() const {
  for (const auto& [name, entry] : entries_)
    require(used_.contains(name), array_name(name), "is unknown", "this release does not know it");
  for (const auto& [name, text] : texts_)
    require(name == checksum_name || used_.contains(texts_key + name), texts_key,
            "unknown member '" + name + "'", "this release does not know it");
}

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
