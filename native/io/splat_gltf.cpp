// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/splat_gltf.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "core/errors.h"
#include "io/document.h"
#include "io/output_file.h"

namespace arapfields {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr Index rows_at_a_time = 1 << 14;  // rows that are written at a time
constexpr std::uint32_t gltf_magic = 0x46546C67, gltf_version = 2, json_chunk = 0x4E4F534A,
                        binary_chunk = 0x004E4942;
constexpr int float_component = 5126, array_buffer = 34962, points_mode = 0;

/// One quantity of all splats: `width` numbers each, of splat i by `put(i, out)`.
struct Attribute {
  std::string name;
  int width;
  std::function<void(Index, float*)> put;

  const char* type() const { return width == 1 ? "SCALAR" : width == 3 ? "VEC3" : "VEC4"; }
};

std::vector<Attribute> attributes_of(const GaussianSplats& splats) {
  const auto row = [](const auto& matrix, int first) {
    return [&matrix, first](Index i, float* out) {
      for (int c = 0; c < 3; ++c) out[c] = matrix(i, first + c);
    };
  };
  std::vector<Attribute> result;
  const std::string own = "KHR_gaussian_splatting:";
  result.push_back({"POSITION", 3, row(splats.centers, 0)});
  result.push_back({own + "ROTATION", 4, [&](Index i, float* out) {
                      for (int c = 0; c < 4; ++c) out[c] = splats.rotations(i, (c + 1) % 4);  // x, y, z, w
                    }});
  result.push_back({own + "SCALE", 3, [&](Index i, float* out) {
                      for (int c = 0; c < 3; ++c) out[c] = std::exp(splats.log_scales(i, c));
                    }});
  result.push_back({own + "OPACITY", 1, [&](Index i, float* out) {
                      out[0] = 1.0f / (1.0f + std::exp(-splats.opacity_logits[i]));
                    }});
  int first = 0;
  for (int degree = 0; first < splats.harmonics.cols(); ++degree)
    for (int k = 0; k <= 2 * degree; ++k, first += 3)
      result.push_back({own + "SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(k), 3,
                        row(splats.harmonics, first)});
  return result;
}

Json document_of(const GaussianSplats& splats, const std::vector<Attribute>& attributes,
                 const std::string& name) {
  Json accessors = Json::array(), views = Json::array(), named = Json::object();
  std::size_t offset = 0;
  for (std::size_t k = 0; k < attributes.size(); ++k) {
    const Attribute& one = attributes[k];
    const std::size_t bytes = sizeof(float) * static_cast<std::size_t>(one.width * splats.size());
    views.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}, {"target", array_buffer}});
    accessors.push_back({{"bufferView", k},
                         {"componentType", float_component},
                         {"count", splats.size()},
                         {"type", one.type()}});
    named[one.name] = k;
    offset += bytes;
  }
  const Eigen::RowVector3f low = splats.centers.colwise().minCoeff(),
                           high = splats.centers.colwise().maxCoeff();
  accessors[0]["min"] = {low[0], low[1], low[2]};
  accessors[0]["max"] = {high[0], high[1], high[2]};
  const Json extension = {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}};
  const Json primitive = {
      {"mode", points_mode}, {"attributes", named}, {"extensions", {{"KHR_gaussian_splatting", extension}}}};
  return {{"asset", {{"version", "2.0"}, {"generator", "ARAP Fields"}}},
          {"extensionsUsed", {"KHR_gaussian_splatting"}},
          {"scene", 0},
          {"scenes", {{{"nodes", {0}}}}},
          {"nodes", {{{"name", name}, {"mesh", 0}}}},
          {"meshes", {{{"name", name}, {"primitives", {primitive}}}}},
          {"accessors", accessors},
          {"bufferViews", views},
          {"buffers", {{{"byteLength", offset}}}}};
}

/// Splats whose z is up, turned to glTF's axes, with their own axes exchanged likewise.
GaussianSplats with_y_up(const GaussianSplats& splats, const Progress& progress) {
  Mat4 turn = Mat4::Zero();
  turn(0, 0) = turn(1, 2) = turn(3, 3) = 1.0;
  turn(2, 1) = -1.0;
  GaussianSplats turned = transform_splats(splats, turn, progress);
  for (Index i = 0; i < splats.size(); ++i) {
    const Eigen::RowVector4f q = splats.rotations.row(i);
    const Eigen::RowVector3f scales = splats.log_scales.row(i);
    turned.rotations.row(i) << q[0], q[1], q[3], -q[2];
    turned.log_scales.row(i) << scales[0], scales[2], scales[1];
  }
  return turned;
}

}  // namespace

void save_splats_gltf(const std::string& path, const GaussianSplats& splats, const std::string& name,
                      bool z_up, const Progress& progress) {
  if (z_up) {
    save_splats_gltf(path, with_y_up(splats, progress.part(0.0, 0.4)), name, false, progress.part(0.4, 1.0));
    return;
  }
  splats.validate();
  require(splats.size() > 0, "splats", "none", "glTF needs at least one");
  const std::vector<Attribute> attributes = attributes_of(splats);
  std::string document =
      document_of(splats, attributes, name).dump(-1, ' ', false, Json::error_handler_t::replace);
  document.resize((document.size() + 3) / 4 * 4, ' ');
  Index width = 0;
  for (const Attribute& one : attributes) width += one.width;
  const double bytes = static_cast<double>(sizeof(float)) * static_cast<double>(width * splats.size()),
               all = 28.0 + static_cast<double>(document.size()) + bytes;  // with three headers
  require(all <= std::numeric_limits<std::uint32_t>::max(), "splats", std::to_string(splats.size()),
          "a binary glTF file holds 4 GB at most; write PLY");
  const auto size = [](double number) { return static_cast<std::uint32_t>(number); };
  OutputFile file(path);
  const std::uint32_t head[] = {gltf_magic, gltf_version, size(all),
                                size(static_cast<double>(document.size())), json_chunk};
  file.write(head, sizeof(head));
  file.write(document.data(), document.size());
  const std::uint32_t binary[] = {size(bytes), binary_chunk};
  file.write(binary, sizeof(binary));
  std::vector<float> numbers;
  Index done = 0;
  for (const Attribute& one : attributes) {
    for (Index first = 0; first < splats.size(); first += rows_at_a_time) {
      const Index count = std::min(rows_at_a_time, splats.size() - first);
      progress.report(static_cast<double>(done) / static_cast<double>(width * splats.size()));
      numbers.resize(static_cast<std::size_t>(count * one.width));
      for (Index i = 0; i < count; ++i) one.put(first + i, numbers.data() + i * one.width);
      file.write(numbers.data(), sizeof(float) * numbers.size());
      done += count * one.width;
    }
  }
  file.commit();
}

}  // namespace arapfields
