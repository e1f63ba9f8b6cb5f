// SPDX-License-Identifier: GPL-3.0-or-later
// The example of docs/development.md: a field that the library does not know, in all that takes fields.
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "attach/attachment.h"
#include "core/random.h"
#include "energies/arap.h"
#include "energies/distortion.h"
#include "extraction/extract_deformed.h"
#include "fields/inverse.h"
#include "neural/neural_sdf.h"
#include "solve/mesh_measures.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(foreign_field)

namespace {

// [roll]
/// Rolls space about y: x becomes an angle, `curvature` times x, about z = −1/curvature.
class Roll final : public DeformationField {
 public:
  explicit Roll(double curvature) : curvature_(curvature) {}

  void evaluate(PointsIn points, JetView<double> out) const override {
    const double k = curvature_;
    for (Index p = 0; p < points.rows(); ++p) {
      const double radius = points(p, 2) + 1.0 / k, s = std::sin(k * points(p, 0)),
                   c = std::cos(k * points(p, 0));
      const auto set = [&](int column, double x, double y, double z) {
        double* const entry = out.at(column, p);
        entry[0] = x, entry[1] = y, entry[2] = z;
      };
      set(0, radius * s, points(p, 1), radius * c - 1.0 / k);
      if (out.order == JetOrder::value) continue;
      set(first_column(0), k * radius * c, 0.0, -k * radius * s);
      set(first_column(1), 0.0, 1.0, 0.0);
      set(first_column(2), s, 0.0, c);
      if (out.order == JetOrder::first) continue;
      for (int column = 4; column < 10; ++column) set(column, 0.0, 0.0, 0.0);
      set(second_column(0, 0), -k * k * radius * s, 0.0, -k * k * radius * c);
      set(second_column(0, 2), k * c, 0.0, -k * s);
    }
  }

 private:
  double curvature_;
};
// [roll]

/// Scales space, and lifts what is above a plane z = const by a jump, over a short way.
class Jump final : public DeformationField {
 public:
  static constexpr double scale = 1.2, from = 0.01, way = 0.01;
  explicit Jump(double height) : height_(height) {}

  void evaluate(PointsIn points, JetView<double> out) const override {
    for (Index p = 0; p < points.rows(); ++p) {
      const double share = (points(p, 2) - from) / way;
      Eigen::Map<Vec3>(out.at(0, p)) =
          scale * points.row(p).transpose() + height_ * std::clamp(share, 0.0, 1.0) * Vec3::UnitZ();
      if (out.order == JetOrder::value) continue;
      for (int k = 0; k < 3; ++k) Eigen::Map<Vec3>(out.at(first_column(k), p)) = scale * Vec3::Unit(k);
      if (share > 0.0 && share < 1.0) out.at(first_column(2), p)[2] += height_ / way;
    }
  }

 private:
  double height_;
};

Points some_points(Index count) {
  Random random(7);
  Points points(count, 3);
  for (Index i = 0; i < count; ++i)
    for (int k = 0; k < 3; ++k) points(i, k) = random.uniform(-0.5, 0.5);
  return points;
}

// Compiled, so that the documentation's calls are right; the tests below run the same ones on their own
// points.
[[maybe_unused]] void calls(const Points& points, const Points& images, const ImplicitFunction& sdf) {
  // [calls]
  JetBlock<double> jets(points.rows(), JetOrder::second);
  Roll(0.9).evaluate(points, jets.view());
  const ArapValue value =
      arap_energy<double>(std::as_const(jets).view(), 0.0, 1.0, {});  // value.stretch, value.bend
  const Distortion worst = distortion<double>(std::as_const(jets).view());
  const InverseResult rest = invert(Roll(0.9), images);
  const TriangleMesh mesh = extract_deformed(sdf, Roll(0.9), nullptr, 128);
  // [calls]
  static_cast<void>(value), static_cast<void>(worst), static_cast<void>(rest), static_cast<void>(mesh);
}

/// A unit square with side × side samples in a grid.
SurfaceSamples plate_of(Index side) {
  SurfaceSamples plate;
  plate.points.resize(side * side, 3);
  for (Index i = 0; i < side; ++i)
    for (Index j = 0; j < side; ++j)
      plate.points.row(i * side + j) << static_cast<double>(i) / static_cast<double>(side) - 0.5,
          static_cast<double>(j) / static_cast<double>(side) - 0.5, 0.0;
  plate.normals = Vec3::UnitZ().transpose().replicate(side * side, 1);
  return plate;
}

/// Stretches x, and z by x − `from`: det J is 2 (x − from).
class Wedge final : public DeformationField {
 public:
  explicit Wedge(double from) : from_(from) {}

  void evaluate(PointsIn points, JetView<double> out) const override {
    for (Index p = 0; p < points.rows(); ++p) {
      const double x = points(p, 0), z = points(p, 2);
      Eigen::Map<Vec3>(out.at(0, p)) = Vec3(2.0 * x, points(p, 1), z * (x - from_));
      if (out.order == JetOrder::value) continue;
      Eigen::Map<Vec3>(out.at(first_column(0), p)) = Vec3(2.0, 0.0, z);
      Eigen::Map<Vec3>(out.at(first_column(1), p)) = Vec3(0.0, 1.0, 0.0);
      Eigen::Map<Vec3>(out.at(first_column(2), p)) = Vec3(0.0, 0.0, x - from_);
    }
  }

 private:
  double from_;
};

}  // namespace

BOOST_AUTO_TEST_CASE(clothes_keep_their_place_above_the_surface_whatever_the_field_is_beside_it) {
  const SurfaceSamples plate = plate_of(50);
  Points cloth = 0.5 * some_points(300);
  cloth.col(2).setConstant(0.028);
  cloth.middleRows(100, 100).col(2).setConstant(0.9 * Jump::from);
  cloth.bottomRows(100).col(2).setConstant(0.2);
  const Attachment attachment(plate, cloth);
  const Points scaled = Jump::scale * cloth;
  for (const double height : {0.3, 0.01}) {
    const Points off = attachment.positions(Jump(height)) - scaled;
    BOOST_TEST(off.topRows(200).cwiseAbs().maxCoeff() < 1e-12);
    BOOST_TEST(off.bottomRows(100).cwiseAbs().maxCoeff() < 1e-6);  // frames blend in single precision
  }
  BOOST_TEST(Attachment(plate, Points(0, 3)).positions(Jump(0.3)).rows() == 0);
}

BOOST_AUTO_TEST_CASE(clothes_on_what_rolls_up_keep_their_distance_or_go_with_the_field) {
  const SurfaceSamples plate = plate_of(60);
  Points cloth = 0.6 * some_points(200);
  cloth.col(2).setConstant(0.02);
  // Off a roll's axis by 1/k − z, so as far from the surface as at rest; the field has that, too.
  const auto off = [&](double k) {
    return (Attachment(plate, cloth).positions(Roll(k)) - Roll(k).at(cloth)).rowwise().norm().maxCoeff();
  };
  BOOST_TEST(off(1.0) < 0.02 * 0.02);  // of the distance: means over a disk cut corners
  for (const double wound : {30.0, -30.0}) BOOST_TEST(off(wound) < 0.25 * 0.02);
}

BOOST_AUTO_TEST_CASE(energies_take_its_jets) {
  const double k = 0.9;
  const Points points = some_points(200);
  JetBlock<double> jets(points.rows(), JetOrder::second);
  Roll(k).evaluate(points, jets.view());
  const ArapValue value = arap_energy<double>(std::as_const(jets).view(), 0.0, 1.0, {});
  // J is a turn by k·x times diag(1 + k·z, 1, 1): the stretch is (k·z)², and the turn has speed k.
  const Vector stretched = 1.0 + k * points.col(2).array();
  BOOST_TEST(value.stretch == (stretched.array() - 1.0).square().mean(), boost::test_tools::tolerance(1e-10));
  BOOST_TEST(value.bend == k * k * (stretched.array() + 1.0).mean(), boost::test_tools::tolerance(1e-10));
  const Distortion found = distortion<double>(std::as_const(jets).view());
  BOOST_TEST(found.min_determinant == stretched.minCoeff(), boost::test_tools::tolerance(1e-10));
  BOOST_TEST(found.max_stretch == std::max(1.0, stretched.maxCoeff()), boost::test_tools::tolerance(1e-10));
}

BOOST_AUTO_TEST_CASE(newtons_method_inverts_it) {
  const Roll roll(0.9);
  const Points points = some_points(300);
  Points images(points.rows(), 3);
  roll.evaluate(points, {images.data(), images.rows(), JetOrder::value});
  const InverseResult back = invert(roll, images);
  BOOST_TEST(back.failures == 0);
  BOOST_TEST((back.points - points).rowwise().norm().maxCoeff() < 1e-6);
}

BOOST_AUTO_TEST_CASE(a_fold_near_a_corner_alone_is_told) {
  TriangleMesh mesh{Points(4, 3), Triangles(2, 3)};
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0.5, 1, 0;
  mesh.triangles << 0, 1, 2, 1, 2, 3;
  const MeshMeasures found = measure_triangles(Wedge(0.1), mesh);
  BOOST_TEST(found.folded == 1);
  BOOST_TEST(found.folded_place[0] < 0.1);
  BOOST_TEST(found.distortion.min_determinant == 2.0 * (found.folded_place[0] - 0.1),
             boost::test_tools::tolerance(1e-12));
  BOOST_TEST(warnings_on(found).size() == 1);
  BOOST_TEST(measure_triangles(Wedge(0.7), mesh).folded == 2);  // the middle of one, a corner of the other
  BOOST_TEST(warnings_on(measure_triangles(Wedge(-0.1), mesh)).empty());
}

BOOST_AUTO_TEST_SUITE_END()
