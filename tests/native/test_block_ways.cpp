// SPDX-License-Identifier: GPL-3.0-or-later
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "solve/radial/block_ways.h"

using namespace arapfields;

namespace {

constexpr Index rings = 200, around = BlockWays::block_size;

/// Rings along x, a block each.
Points bar() {
  Points points(rings * around, 3);
  for (Index i = 0; i < points.rows(); ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i % around) / around;
    const double x = 1.6 * static_cast<double>(i / around) / rings - 0.8;
    points.row(i) << x, 0.02 * std::cos(angle), 0.02 * std::sin(angle);
  }
  return points;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(block_ways)

BOOST_AUTO_TEST_CASE(what_was_not_looked_at_is_farther) {
  constexpr double floor = -0.3, reach = 0.04;
  const Points rest = bar();
  const RadialBasis basis = radial_basis(rest, {{40, 4.0}});
  const RadialEvaluator<float> all(basis, rest, JetOrder::value);
  BlockWays ways(basis, rest, Points(0, 3));
  RowMatrix<double> coefficients = basis.identity();
  RowMatrix<double> rates = RowMatrix<double>::Zero(basis.size(), 3);
  Random random(7);
  Index looked = 0, moves = 0, near = 0;
  double height = floor;
  for (; moves < 200; ++moves) {
    for (Index i = 0; i < rates.size(); ++i) rates.data()[i] += 1.2e-3 * (random.uniform() - 0.5);
    coefficients += rates;
    if (moves % 50 == 49) rates *= -1.0;
    const double before = height;
    height = floor + 0.1 * std::sin(0.1 * static_cast<double>(moves));
    ways.narrow(std::abs(height - before));
    ways.move_to(coefficients);
    PointsF now(rest.rows(), 3);
    all.evaluate(coefficients, {now.data(), now.rows(), JetOrder::value});
    for (Index b = 0; b < ways.count(); ++b) {
      const Points places = now.middleRows(around * b, around).cast<double>();
      const double free = places.col(2).minCoeff() - height;
      if (!ways.may_be_near(b, reach, false)) {
        BOOST_TEST(free > reach);
        continue;
      }
      ways.see(b, places);
      ways.set_free(b, free);
      ++looked;
      near += free < reach ? 1 : 0;
    }
  }
  BOOST_TEST(near > 100);
  BOOST_TEST(looked < moves * rings / 2);
  BOOST_TEST_MESSAGE("near " << near << ", looked at " << looked << " of " << moves * rings);
}

BOOST_AUTO_TEST_SUITE_END()
