// SPDX-License-Identifier: GPL-3.0-or-later
// Just enough of Wavefront OBJ for the example: vertices and triangles.
#pragma once

#include <arapfields/errors.h>
#include <arapfields/mesh.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

inline arapfields::TriangleMesh read_obj(const std::string& path) {
  std::vector<double> coordinates;
  std::vector<std::int32_t> corners;
  std::ifstream file(path);
  if (!file) throw arapfields::InvalidInput(path, "it cannot be read", "an OBJ file is needed");
  for (std::string line, word; std::getline(file, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v")
      for (double x; words >> x;) coordinates.push_back(x);
    else if (word == "f")
      for (std::string corner; words >> corner;) corners.push_back(std::stoi(corner) - 1);  // "7/8/9": 7
  }
  if (corners.empty()) throw arapfields::InvalidInput(path, "it has no faces", "a triangle mesh is needed");
  return {Eigen::Map<const arapfields::Points>(coordinates.data(), coordinates.size() / 3, 3),
          Eigen::Map<const arapfields::Triangles>(corners.data(), corners.size() / 3, 3)};
}

inline void write_obj(const std::string& path, const arapfields::TriangleMesh& mesh) {
  std::ofstream file(path);
  for (const auto& v : mesh.vertices.rowwise()) file << "v " << v << "\n";
  for (const auto& f : mesh.triangles.rowwise()) file << "f " << (f.array() + 1) << "\n";
  if (!file.flush()) throw arapfields::InvalidInput(path, "it cannot be written", "is the disk full?");
}
