// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>

#include "sampling/standing_out.h"

using namespace arapfields;

namespace {

constexpr Index around = 80, up = 40;
constexpr double spacing = 0.05;

/// Rings of a cone of slope one that stands on z = 0, its tip of height one left out, and their normals.
std::pair<Points, Points> cone() {
  Points points(around * up, 3), normals(around * up, 3);
  for (Index i = 0; i < points.rows(); ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i % around) / around;
    const double radius = 1.0 - 0.95 * static_cast<double>(i / around) / (up - 1);
    points.row(i) << radius * std::cos(angle), radius * std::sin(angle), 1.0 - radius;
    normals.row(i) << std::sqrt(0.5) * std::cos(angle), std::sqrt(0.5) * std::sin(angle), std::sqrt(0.5);
  }
  return {points, normals};
}

}  // namespace

BOOST_AUTO_TEST_SUITE(standing_out_of_samples)

BOOST_AUTO_TEST_CASE(a_tip_stands_out_of_a_cone_and_its_sides_do_not) {
  const auto [samples, normals] = cone();
  Points points(4, 3);
  points << 0.5, 0.0, 0.5, 0.0, 0.0, 1.0, 0.01, 0.0, 0.99, -0.3, 0.4, 0.5;
  BOOST_TEST(standing_out(points, samples, normals, spacing, 1e-3, 100) == std::vector<Index>{1},
             boost::test_tools::per_element());
  BOOST_TEST(standing_out(points, samples, normals, spacing, 0.06, 100).empty());
  BOOST_TEST(standing_out(points, samples, normals, spacing, 1e-3, 0).empty());
}

BOOST_AUTO_TEST_CASE(the_bottom_of_a_funnel_does_not_stand_out) {
  const auto [samples, normals] = cone();
  Points points(1, 3);
  points << 0.0, 0.0, 1.0;
  BOOST_TEST(standing_out(points, samples, -normals, spacing, 1e-3, 100).empty());
  BOOST_TEST(standing_out(Points(0, 3), samples, normals, spacing, 1e-3, 100).empty());
}

BOOST_AUTO_TEST_SUITE_END()
