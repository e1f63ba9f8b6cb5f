// SPDX-License-Identifier: GPL-3.0-or-later
// The motion of the whole that locality is measured from (its values and slopes: test_terms.cpp).
#include <Eigen/Geometry>
#include <boost/test/unit_test.hpp>

#include "energies/shared_motion.h"

using namespace arapfields;

namespace {

Points grid() {
  Points points(1000, 3);
  for (Index i = 0; i < points.rows(); ++i)
    points.row(i) << 0.1 * (i % 10) - 0.45, 0.1 * (i / 10 % 10) - 0.45, 0.1 * (i / 100) - 0.45;
  return points;
}

Handle box(const Vec3& middle, const Mat4& motion) {
  Handle handle;
  handle.rest.diagonal() << 0.15, 0.15, 0.15, 1.0;
  handle.rest.topRightCorner<3, 1>() = middle;
  handle.target = motion * handle.rest;
  return handle;
}

Handle pin(const Vec3& place, const Mat4& motion) {
  Handle handle;
  handle.kind = Handle::Kind::point;
  handle.rest_point = place;
  handle.target_point = (motion * place.homogeneous()).head<3>();
  return handle;
}

Mat4 turned(double angle, const Vec3& shift) {
  Mat4 motion = Mat4::Identity();
  motion.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(angle, Vec3(1.0, 2.0, -1.0).normalized()).toRotationMatrix();
  motion.topRightCorner<3, 1>() = shift;
  return motion;
}

const Vec3 places[] = {{-0.3, -0.3, 0.3}, {0.3, -0.3, -0.3}, {-0.3, 0.3, -0.3}, {0.3, 0.3, 0.3}};
const Mat4 rest = Mat4::Identity(), whole = turned(0.4, {0.1, 0.02, -0.05}),
           other = turned(-0.3, {0.2, 0.0, 0.1});

template <class Make>
Mat4 shared(Make&& make, const std::vector<Mat4>& motions, int axis = -1) {
  std::vector<Handle> handles;
  for (std::size_t i = 0; i < motions.size(); ++i) handles.push_back(make(places[i], motions[i]));
  return shared_motion(BoundHandles(handles, grid()), grid().rows(), axis);
}

void check(const Mat4& found, const Mat4& expected) { BOOST_TEST((found - expected).norm() < 1e-9); }

}  // namespace

BOOST_AUTO_TEST_SUITE(locality)

BOOST_AUTO_TEST_CASE(the_motion_that_most_handles_share) {
  for (const auto& make : {&box, &pin}) {
    check(shared(make, {whole, whole, whole, whole}), whole);
    check(shared(make, {whole, other, whole, whole}), whole);
    check(shared(make, {whole, other, other, whole}), rest);
    check(shared(make, {whole, other}), rest);
  }
}

BOOST_AUTO_TEST_CASE(a_handle_alone_moves_the_whole_if_it_holds_most_of_it) {
  check(shared(&box, {whole}), rest);
  check(shared(&pin, {whole}), rest);
  Handle all = box(Vec3::Zero(), whole);
  all.rest.diagonal() << 1.0, 1.0, 1.0, 1.0;
  all.target = whole * all.rest;
  check(shared_motion(BoundHandles({all}, grid()), grid().rows()), whole);
}

BOOST_AUTO_TEST_CASE(what_stays_is_where_the_rest_stays) {
  for (const auto& make : {&box, &pin}) {
    check(shared(make, {rest, rest, rest, other}), rest);
    check(shared(make, {rest, other, other, other}), rest);
    check(shared(make, {rest}), rest);
  }
}

BOOST_AUTO_TEST_CASE(two_pins_that_keep_their_distance_turn_nothing) {
  const Vec3 way(0.05, 0.1, 0.0), apart = places[1] - places[0];
  Mat4 first = turned(0.0, way), second = first;
  second.topRightCorner<3, 1>() =
      way + Eigen::AngleAxisd(0.7, Vec3::UnitX()) * apart - apart;  // as far from the first one as before
  check(shared(&pin, {first, second}), rest);
}

BOOST_AUTO_TEST_CASE(with_symmetry_it_is_symmetric) {
  Mat4 along = turned(0.0, Vec3(0.0, 0.1, 0.2)), across = turned(0.0, Vec3(0.3, 0.1, 0.2));
  check(shared(&box, {along, along}, 0), along);
  Handle all = box(Vec3::Zero(), across);
  all.rest.diagonal() << 1.0, 1.0, 1.0, 1.0;
  all.target = across * all.rest;
  check(shared_motion(BoundHandles({all}, grid()), grid().rows(), 0), along);
}

BOOST_AUTO_TEST_SUITE_END()
