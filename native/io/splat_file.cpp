// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/splat_file.h"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <sstream>
#include <vector>

#include "core/errors.h"
#include "io/input_file.h"
#include "io/output_file.h"

namespace arapfields {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t longest_header = 1 << 16;
constexpr Index chunk = 1 << 14;  // rows that are read or written at a time
const std::map<std::string, std::size_t> type_sizes = {
    {"char", 1},  {"uchar", 1},   {"int8", 1},   {"uint8", 1},  {"short", 2}, {"ushort", 2},
    {"int16", 2}, {"uint16", 2},  {"int", 4},    {"uint", 4},   {"int32", 4}, {"uint32", 4},
    {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};

struct Property {
  std::string type, name;
  std::size_t offset;
};

struct Header {
  Index count = 0;
  std::size_t stride = 0, begin = 0;
  std::vector<Property> properties;
};

/// The names of a splat's numbers, in the order of `record`: center, DC, other harmonics channel by channel,
/// opacity, scales, rotation.
std::vector<std::string> names(Index harmonics) {
  std::vector<std::string> result = {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (Index i = 0; i < 3 * (harmonics - 1); ++i) result.push_back("f_rest_" + std::to_string(i));
  result.push_back("opacity");
  for (const char* name : {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    result.emplace_back(name);
  return result;
}

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw InvalidInput(path + ": " + what);
}

Header read_header(const std::string& path, const InputFile& file) {
  std::string text(std::min(longest_header, file.size()), '\0');
  file.read(0, text.data(), text.size());
  constexpr std::string_view last = "end_header";
  const std::size_t end = text.find(last), line_end = text.find('\n', end);
  if (!text.starts_with("ply") || end == std::string::npos || line_end == std::string::npos)
    refuse(path, "is no PLY file, or its header is cut off");
  Header header;
  header.begin = line_end + 1;
  std::istringstream lines(text.substr(0, end));
  bool in_vertex = false, in_other = false;
  std::string format;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (word == "format") {
      words >> format;
    } else if (word == "element") {
      double count = -1.0;
      words >> name >> count;
      in_vertex = name == "vertex" && !in_other && header.properties.empty();
      in_other = in_other || !in_vertex;
      if (!(count >= 0.0 && count < 4294967296.0)) refuse(path, "element " + name + " has no count");
      if (!in_vertex && count > 0.0)
        refuse(path, "has elements " + name + " too; splats as vertices alone can be read");
      if (in_vertex) header.count = static_cast<Index>(count);
    } else if (word == "property" && in_vertex) {
      words >> type >> name;
      const auto size = type_sizes.find(type);
      if (size == type_sizes.end() || name.empty())
        refuse(path, "property " + type + " " + name + " is unknown");
      header.properties.push_back({type, name, header.stride});
      header.stride += size->second;
    }
  }
  if (format != "binary_little_endian")
    refuse(path, "is of the format '" + format + "'; binary_little_endian is needed");
  return header;
}

/// How many harmonics a header's properties have; 0: they are no splats'.
Index harmonics_of(const Header& header) {
  Index rest = 0;
  for (const Property& property : header.properties) rest += property.name.starts_with("f_rest_");
  for (const Index count : {1, 4, 9, 16}) {
    if (rest != 3 * (count - 1)) continue;
    const auto has = [&](const std::string& name) {
      return std::ranges::any_of(header.properties, [&](const Property& p) {
        return p.name == name && (p.type == "float" || p.type == "float32");
      });
    };
    if (std::ranges::all_of(names(count), has)) return count;
  }
  return 0;
}

/// The numbers of row i, one for each of names().
Eigen::RowVectorXf record(const GaussianSplats& splats, Index i) {
  const Index harmonics = splats.harmonics.cols() / 3;
  Eigen::RowVectorXf result(14 + 3 * (harmonics - 1));
  const auto colours = splats.harmonics.row(i);
  result << splats.centers.row(i), colours.head<3>(), Eigen::RowVectorXf::Zero(3 * (harmonics - 1)),
      splats.opacity_logits[i], splats.log_scales.row(i), splats.rotations.row(i);
  for (Index k = 1; k < harmonics; ++k)
    for (Index c = 0; c < 3; ++c) result[6 + c * (harmonics - 1) + k - 1] = colours[3 * k + c];
  return result;
}

void take(GaussianSplats& splats, Index i, const Eigen::RowVectorXf& numbers) {
  const Index harmonics = splats.harmonics.cols() / 3, after = 6 + 3 * (harmonics - 1);
  splats.centers.row(i) = numbers.head<3>();
  splats.harmonics.row(i).head<3>() = numbers.segment<3>(3);
  for (Index k = 1; k < harmonics; ++k)
    for (Index c = 0; c < 3; ++c) splats.harmonics(i, 3 * k + c) = numbers[6 + c * (harmonics - 1) + k - 1];
  splats.opacity_logits[i] = numbers[after];
  splats.log_scales.row(i) = numbers.segment<3>(after + 1);
  splats.rotations.row(i) = numbers.segment<4>(after + 4);
}

/// The logit of an opacity may be infinite: that of 1, opaque, or of 0, invisible.
void require_usable(const std::string& path, Index splat, const Eigen::RowVectorXf& numbers,
                    const std::vector<std::string>& wanted) {
  if (numbers.allFinite()) return;
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const float number = numbers[static_cast<Index>(k)];
    const bool is_opacity = wanted[k] == "opacity";
    if (std::isnan(number) || (std::isinf(number) && !is_opacity))
      refuse(path, "splat " + std::to_string(splat) + " has " + (std::isnan(number) ? "NaN" : "infinity") +
                       " as " + wanted[k]);
  }
}

GaussianSplats sized(const Header& header, Index harmonics, const std::vector<const Property*>& others) {
  GaussianSplats splats;
  splats.centers.resize(header.count, 3);
  splats.rotations.resize(header.count, 4);
  splats.log_scales.resize(header.count, 3);
  splats.opacity_logits.resize(header.count);
  splats.harmonics.resize(header.count, 3 * harmonics);
  std::size_t bytes = 0;
  for (const Property* property : others) {
    splats.other_properties += "property " + property->type + " " + property->name + "\n";
    bytes += type_sizes.at(property->type);
  }
  splats.other_values.resize(header.count, static_cast<Index>(bytes));
  return splats;
}

/// Quaternions of any length are allowed in files.
void normalise(const std::string& path, GaussianSplats& splats) {
  for (Index i = 0; i < splats.size(); ++i) {
    const float length = splats.rotations.row(i).norm();
    if (!(length > 0.0f)) refuse(path, "the rotation of splat " + std::to_string(i) + " is zero");
    if (std::abs(length - 1.0f) > 1e-6f) splats.rotations.row(i) /= length;
  }
}

}  // namespace

bool is_splat_file(const std::string& path) {
  try {
    return harmonics_of(read_header(path, InputFile(path))) > 0;
  } catch (const std::exception&) {
    return false;
  }
}

GaussianSplats load_splats(const std::string& path, const Progress& progress) {
  const InputFile file(path);
  const Header header = read_header(path, file);
  const Index harmonics = harmonics_of(header);
  if (harmonics == 0)
    refuse(path,
           "lacks properties of splats; x, y, z, f_dc_*, f_rest_* (0, 9, 24 or 45 of them), opacity, "
           "scale_* and rot_* are needed, all float");
  if (static_cast<std::size_t>(header.count) > (file.size() - header.begin) / header.stride)
    refuse(path, "is cut off: it lacks rows of the " + std::to_string(header.count) + " it tells of");
  const std::vector<std::string> wanted = names(harmonics);
  std::map<std::string, const Property*> known;
  std::vector<const Property*> others;
  for (const Property& property : header.properties) {
    if (std::ranges::find(wanted, property.name) == wanted.end())
      others.push_back(&property);
    else if (!known.emplace(property.name, &property).second)
      refuse(path, "has two properties " + property.name);
  }
  GaussianSplats splats = sized(header, harmonics, others);
  std::vector<char> rows(static_cast<std::size_t>(chunk) * header.stride);
  std::vector<std::size_t> offsets;
  for (const std::string& name : wanted) offsets.push_back(known.at(name)->offset);
  Eigen::RowVectorXf numbers(static_cast<Index>(wanted.size()));
  for (Index first = 0; first < header.count; first += chunk) {
    progress.report(static_cast<double>(first) / static_cast<double>(header.count));
    const Index count = std::min(chunk, header.count - first);
    file.read(header.begin + static_cast<std::size_t>(first) * header.stride, rows.data(),
              static_cast<std::size_t>(count) * header.stride);
    for (Index i = 0; i < count; ++i) {
      const char* row = rows.data() + static_cast<std::size_t>(i) * header.stride;
      for (std::size_t k = 0; k < offsets.size(); ++k)
        std::memcpy(&numbers[static_cast<Index>(k)], row + offsets[k], sizeof(float));
      require_usable(path, first + i, numbers, wanted);
      take(splats, first + i, numbers);
      char* other = splats.other_values.data() + (first + i) * splats.other_values.cols();
      for (const Property* property : others) {
        const std::size_t size = type_sizes.at(property->type);
        std::memcpy(other, row + property->offset, size);
        other += size;
      }
    }
  }
  normalise(path, splats);
  try {
    splats.validate();
  } catch (const InvalidInput& error) {
    refuse(path, error.what());
  }
  return splats;
}

void save_splats(const std::string& path, const GaussianSplats& splats, const Progress& progress) {
  splats.validate();
  OutputFile file(path);
  std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(splats.size()) + "\n";
  for (const std::string& name : names(splats.harmonics.cols() / 3))
    header += "property float " + name + "\n";
  header += splats.other_properties + "end_header\n";
  file.write(header.data(), header.size());
  std::string rows;
  for (Index first = 0; first < splats.size(); first += chunk) {
    progress.report(static_cast<double>(first) / static_cast<double>(splats.size()));
    rows.clear();
    for (Index i = first; i < std::min(first + chunk, splats.size()); ++i) {
      const Eigen::RowVectorXf numbers = record(splats, i);
      rows.append(reinterpret_cast<const char*>(numbers.data()),
                  sizeof(float) * static_cast<std::size_t>(numbers.size()));
      rows.append(splats.other_values.data() + i * splats.other_values.cols(),
                  static_cast<std::size_t>(splats.other_values.cols()));
    }
    file.write(rows.data(), rows.size());
  }
  file.commit();
}

}  // namespace arapfields
