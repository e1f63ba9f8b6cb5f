// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/frame.h"
#include "core/types.h"
#include "io/input_file.h"

// The metadata that files of every kind share: format, version, kind, structure and report, as texts.

namespace arapfields {

class JsonObject;

inline constexpr const char* checksum_name = "checksum";

/// Named arrays and texts as one file in the layout of safetensors
/// (https://github.com/huggingface/safetensors): eight bytes with the length of a header, little-endian; the
/// header, a JSON object with dtype, shape and data_offsets of each array and the texts under "__metadata__";
/// the arrays, row by row, nothing between them. Nothing is compressed and nothing in a file is executed. One
/// of the texts is a checksum of all that follows the eight bytes, with zeros in the checksum's own place.
class ArchiveWriter {
 public:
  void add(const std::string& name, const std::vector<Index>& shape, const double* data);
  void add(const std::string& name, const std::vector<Index>& shape, const float* data);
  /// Writes the file in whole or not at all. Throws FileError, InvalidInput as OutputFile does.
  void save(const std::string& path, const std::map<std::string, std::string>& texts) const;

 private:
  struct Entry {
    std::string name;
    bool is_double;
    std::vector<Index> shape;
    const void* data;
    std::size_t bytes;
  };
  std::vector<Entry> entries_;
};

/// The same, read without trust: all sizes are checked against the file's before anything is allocated. Every
/// error but the system's own is an InvalidInput.
class ArchiveReader {
 public:
  /// Reads the header. InvalidInput where it is none, or arrays overlap, leave gaps or reach beyond the file,
  /// and where there is a checksum that is not the content's.
  explicit ArchiveReader(const std::string& path);
  bool has_checksum() const { return texts_.contains(checksum_name); }

  /// One of the texts. InvalidInput where it is missing.
  const std::string& text(const std::string& name);
  /// An array that must have this shape; InvalidInput for another, another dtype, NaN and infinities.
  Vector doubles(const std::string& name, const std::vector<Index>& shape);
  VectorF floats(const std::string& name, const std::vector<Index>& shape);
  Points points(const std::string& name, Index count);
  /// InvalidInput for an array or a text that was not read.
  void require_all_used() const;

 private:
  struct Entry {
    std::string dtype;
    std::vector<Index> shape;
    std::size_t begin, end;  ///< in the file
  };
  void read_entry(const std::string& name, const JsonObject& value);
  void compare_checksum(std::string header) const;
  void require_no_gaps(std::size_t begin) const;
  template <class Result>
  Result array(const std::string& name, const std::vector<Index>& shape, const char* dtype);

  InputFile file_;
  std::map<std::string, Entry> entries_;
  std::map<std::string, std::string> texts_;
  std::set<std::string> used_;
  std::size_t data_ = 0;  ///< where arrays begin
};

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
// 2: with a checksum; 3: what an embedding's nodes see of each other; 4: an embedding's fine parts
inline constexpr int file_version = 4;

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
