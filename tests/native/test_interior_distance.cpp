// SPDX-License-Identifier: GPL-3.0-or-later
// What an embedding of interior distances is made from.
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <limits>

#include "fields/multidimensional_scaling.h"
#include "fields/radial_basis.h"
#include "sampling/parts.h"

using namespace arapfields;

namespace {

/// Five fingers of length 1 on a common root, side by side: `points` lie a tenth of a finger apart along
/// each, the landmarks first. Paths from one to another go by the root.
struct Hand {
  static constexpr Index fingers = 5, landmarks = 50, count = 100;
  Points points = Points(count, 3);
  RowMatrix<double> squares = RowMatrix<double>(count, landmarks);  // of paths, less the straight ones
  RowMatrix<double> weights = RowMatrix<double>(count, landmarks);  // less for what is far in space

  Hand() {
    for (Index i = 0; i < count; ++i) points.row(i) << along(i), 0.05 * static_cast<double>(finger(i)), 0.0;
    for (Index i = 0; i < count; ++i)
      for (Index l = 0; l < landmarks; ++l) {
        const double straight = (points.row(i) - points.row(l)).squaredNorm();
        squares(i, l) = std::max(0.0, path(i, l) * path(i, l) - straight);
        weights(i, l) = 1.0 / std::pow(straight + 0.04, 2);
      }
  }
  static Index finger(Index i) { return i % fingers; }
  static double along(Index i) {
    const Index place = i % landmarks / fingers;
    return 0.1 * static_cast<double>(place + 1) - (i < landmarks ? 0.0 : 0.05);
  }
  static double path(Index i, Index j) {
    return finger(i) == finger(j) ? std::abs(along(i) - along(j)) : along(i) + along(j);
  }
  double stress(const Points& coordinates) const {
    double sum = 0.0;
    for (Index i = 0; i < count; ++i)
      for (Index l = 0; l < landmarks; ++l)
        sum += weights(i, l) *
               std::pow((coordinates.row(i) - coordinates.row(l)).norm() - std::sqrt(squares(i, l)), 2);
    return sum;
  }
  /// The least ratio of a distance, with that by the coordinates, to the path, between outer halves.
  double least_ratio(const Points& coordinates) const {
    double least = std::numeric_limits<double>::infinity();
    for (Index i = 0; i < count; ++i)
      for (Index j = 0; j < i; ++j)
        if (finger(i) != finger(j) && along(i) > 0.5 && along(j) > 0.5)
          least = std::min(least, std::sqrt((points.row(i) - points.row(j)).squaredNorm() +
                                            (coordinates.row(i) - coordinates.row(j)).squaredNorm()) /
                                      path(i, j));
    return least;
  }
};

}  // namespace

BOOST_AUTO_TEST_SUITE(interior_distance)

BOOST_AUTO_TEST_CASE(least_stress_keeps_five_fingers_apart) {
  const Hand hand;
  Points coordinates = classical_scaling(hand.squares);
  const double before = hand.stress(coordinates);
  BOOST_TEST(hand.least_ratio(coordinates) < 0.5);  // three coordinates lose two of four
  reduce_stress(hand.squares, hand.weights, coordinates);
  BOOST_TEST(hand.stress(coordinates) < before);
  BOOST_TEST(hand.least_ratio(coordinates) > 0.6);
}

BOOST_AUTO_TEST_CASE(distances_that_three_coordinates_have_stay) {
  const Hand hand;
  RowMatrix<double> squares(Hand::count, Hand::landmarks);
  for (Index i = 0; i < Hand::count; ++i)
    for (Index l = 0; l < Hand::landmarks; ++l)
      squares(i, l) = (hand.points.row(i) - hand.points.row(l)).squaredNorm();
  const Points first = classical_scaling(squares);
  Points second = first;
  reduce_stress(squares, hand.weights, second);
  BOOST_TEST((second - first).cwiseAbs().maxCoeff() < 1e-9);
  for (Index i = 0; i < Hand::count; ++i)
    BOOST_TEST((first.row(i) - first.row(3)).squaredNorm() == squares(i, 3),
               boost::test_tools::tolerance(1e-6));
}

BOOST_AUTO_TEST_CASE(parts_are_joined_where_they_may_be) {
  Points points(4, 3);  // 1 is nearest to 0, but on the other side of a wall; 3 is beside all
  points << 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0;
  const auto wall = [](Index i, Index j) { return (i == 1) == (j == 1) || i == 2 || j == 2; };
  const std::vector<PartLink> free = spanning_links(points, {0, 1, 0, 3}, {0});
  BOOST_REQUIRE(free.size() == 2u);
  BOOST_TEST((free[0] == PartLink(0, 1)));
  const std::vector<PartLink> links = spanning_links(points, {0, 1, 0, 3}, {0}, wall);
  BOOST_REQUIRE(links.size() == 2u);
  BOOST_TEST((links[0] == PartLink(0, 3)));
  BOOST_TEST((links[1] == PartLink(2, 1)));
  const auto never = [](Index, Index) { return false; };
  BOOST_TEST((spanning_links(points, {0, 1, 0, 3}, {0}, never) == free));
}

BOOST_AUTO_TEST_CASE(points_are_far_by_further_coordinates) {
  Points points(3, 3), embedded(3, 3);  // two places of a slit, and one beside them
  points << 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.5, 0.0, 0.0;
  embedded << 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0;
  const FarthestPoints straight = farthest_points(points, 2),
                       inside = farthest_points(points, 2, {}, embedded);
  BOOST_TEST(straight.fill_distance < 0.02);
  BOOST_TEST((std::count(inside.indices.begin(), inside.indices.end(), 1) == 1));
  BOOST_TEST(inside.fill_distance > 0.4);
}

BOOST_AUTO_TEST_SUITE_END()
