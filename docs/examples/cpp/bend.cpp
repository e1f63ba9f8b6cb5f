// SPDX-License-Identifier: GPL-3.0-or-later
// bend IN.obj OUT.obj: the mesh's lower third stays, its upper third is turned by 60 degrees about the x
// axis.
#include <arapfields/arapfields.h>

#include <Eigen/Geometry>
#include <iostream>
#include <numbers>

#include "obj.h"

namespace af = arapfields;

/// The box of the mesh's bounding box between two shares of its height, as a 4×4 that maps [-1,1]³ onto it.
af::Mat4 slab(const af::TriangleMesh& mesh, double from, double to) {
  af::Vec3 low = mesh.vertices.colwise().minCoeff(), high = mesh.vertices.colwise().maxCoeff();
  const double bottom = low.z(), height = high.z() - low.z();
  low.z() = bottom + from * height, high.z() = bottom + to * height;
  Eigen::Affine3d box = Eigen::Affine3d::Identity();
  box.translate(0.5 * (low + high)).scale(Eigen::Vector3d(0.51 * (high - low)));
  return box.matrix();
}

int main(int argc, char** argv) try {
  if (argc != 3) throw af::InvalidInput("arguments", std::to_string(argc - 1), "IN.obj OUT.obj is needed");
  af::TriangleMesh mesh = read_obj(argv[1]);

  af::Handle held, turned;  // boxes at rest, and where they go
  held.rest = held.target = slab(mesh, 0.0, 1.0 / 3);
  turned.rest = slab(mesh, 2.0 / 3, 1.0);
  const Eigen::AngleAxisd turn(std::numbers::pi / 3, af::Vec3::UnitX());
  turned.target = (Eigen::Affine3d(turn) * Eigen::Affine3d(turned.rest)).matrix();

  const af::SurfaceSamples samples = af::sample_mesh(mesh.vertices, mesh.triangles, 5000, 0);
  af::DeformOptions options;
  options.field = af::FieldKind::radial;
  const af::Solution bent = af::deform(samples, {held, turned}, options);
  mesh.vertices = bent.field->at(mesh.vertices);
  write_obj(argv[2], mesh);
  std::cout << "stretch " << bent.report.arap.stretch << ", bend " << bent.report.arap.bend << "\n";
} catch (const af::InvalidInput& error) {
  std::cerr << error.what() << "\n";
  return 2;
}
