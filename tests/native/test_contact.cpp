// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <vector>

#include "core/errors.h"
#include "core/random.h"
#include "distance/mesh_sdf.h"
#include "energies/contact.h"
#include "implicit_shapes.h"
#include "mesh/sample_mesh.h"
#include "shapes.h"
#include "solve/radial/contact_rows.h"
#include "solve/radial/contact_terms.h"
#include "solve/radial/radial_solver.h"

using namespace arapfields;

namespace {

SurfaceSamples bar_samples(std::uint64_t seed = 0) {
  const TriangleMesh mesh = shapes::bar(2.0, 0.2, 24);
  return sample_mesh(mesh.vertices, mesh.triangles, 800, seed);
}

LiveOptions few_centers() {
  LiveOptions options;
  options.samples = 200;
  options.coarse_centers = 0;
  options.fine_centers = 40;
  options.threads = 1;
  return options;
}

/// A block with edges beside the bar's lower side, where contact points are refined.
Contact block_below() {
  const TriangleMesh mesh = shapes::box_mesh({0.1, 0.3, 0.1}, {0.0, 0.0, -0.31});
  Contact contact;
  contact.obstacles.push_back({std::make_shared<MeshSdf>(mesh.vertices, mesh.triangles), 0.02});
  return contact;
}

/// Positions of the planes' points.
Points rows_at(const ContactTerms& contact) {
  const Points places = contact.snapshot().history.places;
  Points result(std::ssize(contact.found().rows), 3);
  for (Index i = 0; i < result.rows(); ++i)
    result.row(i) = places.row(contact.found().rows[static_cast<std::size_t>(i)]);
  return result;
}

}  // namespace

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

BOOST_AUTO_TEST_CASE(a_snapshot_brings_its_own_points_back) {
  const RadialProblem problem(bar_samples(), few_centers(), {}, nullptr, nullptr);
  const RowMatrix<double> rest = problem.basis.identity();
  ContactTerms contact(problem);
  contact.set(block_below(), rest);
  const ContactSnapshot coarse = [&] {
    contact.begin(rest);
    return contact.snapshot();
  }();
  const double depth = contact.find(rest);
  BOOST_TEST(depth > 0.0);
  contact.update_pressures(rows_at(contact).data(), Vector::Ones(contact.surface_count()));
  const ContactSnapshot fine = contact.snapshot();
  const Index points = fine.history.places.rows();
  BOOST_TEST(fine.history.refined.size() > 10u);
  BOOST_TEST(coarse.history.refined.empty());
  BOOST_TEST(points > coarse.history.places.rows());
  BOOST_TEST(fine.history.pressures.maxCoeff() > 0.0);
  RowMatrix<double> away = rest;
  away.row(problem.basis.center_count())[2] += 0.5;
  for (int time = 0; time < 2; ++time) {  // from fewer points, and from as many
    contact.begin(away);
    contact.find(away);
    BOOST_TEST(contact.snapshot().history.refined.empty());
    BOOST_TEST(contact.restore(fine, rest) == depth);
    const ContactSnapshot back = contact.snapshot();
    BOOST_TEST((back.history.refined == fine.history.refined));
    BOOST_TEST((back.history.pressures == fine.history.pressures));
    BOOST_TEST((back.history.sides.clearance.rows() == points && back.history.places.rows() == points));
    BOOST_TEST(std::ssize(contact.found().rows) <= points);
    contact.restore(coarse, away);
    BOOST_TEST(contact.snapshot().history.places.rows() == coarse.history.places.rows());
    contact.restore(fine, rest);
  }
}

BOOST_AUTO_TEST_CASE(a_search_that_fails_leaves_whole_contact) {
  const RadialProblem problem(bar_samples(), few_centers(), {}, nullptr, nullptr);
  const RowMatrix<double> rest = problem.basis.identity();
  bool fails = false;
  const auto below = [&fails](const Vec3& x) {
    if (fails) throw std::runtime_error("fails");
    return x[2] + 0.19;
  };
  Contact given = block_below();
  given.obstacles.push_back({std::make_shared<shapes::Analytic>(below)});
  ContactTerms contact(problem);
  contact.set(given, rest);
  const double depth = contact.find(rest);
  const std::size_t planes = contact.found().planes.size();
  BOOST_TEST(planes > 0u);
  Contact with_another = given;
  with_another.obstacles.back().function = std::make_shared<shapes::Analytic>(below);
  RowMatrix<double> lower = rest;
  lower.row(problem.basis.center_count())[2] -= 0.01;
  for (const auto& call :
       std::vector<std::function<void()>>{[&] { contact.find(lower); }, [&] { contact.begin(lower); },
                                          [&] { contact.set(with_another, lower); }}) {
    fails = true;
    BOOST_CHECK_THROW(call(), std::runtime_error);
    fails = false;
    for (const ContactPlane& plane : contact.found().planes)
      BOOST_TEST(plane.first < std::ssize(contact.found().rows));
    BOOST_TEST(contact.find(lower) > 0.0);
    contact.begin(rest);
    BOOST_TEST(contact.find(rest) == depth);
  }
}

BOOST_AUTO_TEST_CASE(a_motion_state_of_other_samples_is_refused) {
  Handle held;
  held.rest.diagonal() << 0.3, 1.0, 1.0, 1.0;
  held.rest(0, 3) = -0.9;
  held.target = held.rest;
  RadialSolver one(bar_samples(0), {held}, few_centers()), other(bar_samples(1), {held}, few_centers());
  for (RadialSolver* solver : {&one, &other}) {
    solver->set_contact(block_below());
    solver->set_secondary_motion(SecondaryMotion{});
    solver->step({held}, 0.01);
  }
  BOOST_CHECK_THROW(other.set_motion_state(one.motion_state()), InvalidInput);
  other.step({held}, 0.01);
  one.set_motion_state(one.motion_state());
}

BOOST_AUTO_TEST_SUITE_END()
