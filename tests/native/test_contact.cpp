// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "energies/contact.h"
#include "solve/radial/contact_rows.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(contact)

BOOST_AUTO_TEST_CASE(cotangents_are_those_of_differences) {
  std::array<double, 9> places{0.1, -0.2, 0.3, 0.4, 0.2, -0.1, -0.3, 0.5, 0.2}, slopes{};
  const Vec3 normal = Vec3(0.3, -0.5, 0.8).normalized();
  std::vector<ContactPlane> planes{{0, -1, normal, 0.5, 0.0, 0.2, 0},
                                   {1, -1, normal, 0.1, 7.0, 0.3, 0},
                                   {2, 0, normal, 0.1, 1.0, 0.5, 1},
                                   {2, -1, normal, -9.0, 0.5, 0.5, 1},  // out of reach
                                   {0, -1, normal, 0.5, 0.0, 0.2, 0, 0.0, {0.1, -0.2, 0.2}, 3.0},
                                   {1, -1, normal, 0.1, 0.0, 0.2, 0, 0.0, {0.4001, 0.2, -0.1}, 2.0}};
  contact_energy<double>(planes, 50.0, places.data(), slopes.data());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double step = 1e-6, here = places[i];
    places[i] = here + step;
    const double more = contact_energy<double>(planes, 50.0, places.data(), nullptr);
    places[i] = here - step;
    const double less = contact_energy<double>(planes, 50.0, places.data(), nullptr);
    places[i] = here;
    BOOST_TEST(std::abs((more - less) / (2.0 * step) - slopes[i]) < 1e-6);
  }
  BOOST_TEST(slopes[0] != 0.0);
}

BOOST_AUTO_TEST_CASE(a_step_ends_at_the_minimum_along_it) {
  constexpr double stiffness = 50.0, near = 1e-3;
  constexpr int shares = 10000;
  Random random(3);
  int shorter = 0;
  for (int round = 0; round < 200; ++round) {
    Vector places(9), ways(9);
    for (Index i = 0; i < 9; ++i) places[i] = random.uniform() - 0.5, ways[i] = random.uniform() - 0.5;
    std::vector<ContactPlane> planes;
    for (Index k = 0; k < 6; ++k) {
      const Vec3 normal = Vec3(random.uniform() - 0.5, random.uniform() - 0.5, 0.3).normalized();
      planes.push_back(
          {k % 3, k < 4 ? -1 : (k + 1) % 3, normal, random.uniform() - 0.7, random.uniform(), 0.2});
    }
    const auto energy = [&](double t) {
      const Vector there = places + t * ways;
      return contact_energy<double>(planes, stiffness, there.data(), nullptr);
    };
    const auto slope_at = [&](double t) {
      const Vector there = places + t * ways;
      Vector slopes = Vector::Zero(9);
      contact_energy<double>(planes, stiffness, there.data(), slopes.data());
      return slopes.dot(ways);
    };
    constexpr double small = 1e-6;  // no plane is met so near
    const double own = slope_at(0.0), slope = -10.0 - std::abs(own);
    const double curved =
        std::max(-slope - (slope_at(small) - slope_at(-small)) / (2.0 * small), -0.1 * slope);
    double least = 0.0, best = 0.0;
    for (int k = 1; k <= shares; ++k) {
      const double t = static_cast<double>(k) / shares;
      const double value = (slope - own + 0.5 * curved * t) * t + energy(t) - energy(0.0);
      if (value < least) least = value, best = t;
    }
    const double found = contact_step<double>(planes, stiffness, places.data(), ways.data(), slope);
    BOOST_TEST(std::abs(found - best) < near);
    shorter += found < 0.95;
  }
  BOOST_TEST(shorter > 5);
}

BOOST_AUTO_TEST_CASE(forces_are_complementary_to_gaps) {
  constexpr double ridge = 1e-4;  // that is added, as a share of the largest diagonal entry
  std::srand(0);
  for (const Index n : {1, 5, 40})
    for (const Index rank : {n, (n + 1) / 2}) {  // also dependent planes, which some motion satisfies
      const RowMatrix<double> factor = RowMatrix<double>::Random(n, rank);
      const RowMatrix<double> m = factor * factor.transpose();
      Vector q = Vector::Random(n);
      if (rank < n) q = q.cwiseAbs() - 0.5 * factor.rowwise().sum();
      const Vector forces = solve_complementarity(m, q);
      const Vector gaps = m * forces + ridge * m.diagonal().maxCoeff() * forces + q;
      const double size = 1.0 + forces.cwiseAbs().maxCoeff();
      BOOST_TEST(forces.minCoeff() >= 0.0);
      BOOST_TEST(gaps.minCoeff() > -1e-9 * size);
      BOOST_TEST(forces.cwiseProduct(gaps).cwiseAbs().maxCoeff() < 1e-9 * size * size);
    }
}

BOOST_AUTO_TEST_SUITE_END()
