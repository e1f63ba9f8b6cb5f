// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <ctime>
#include <numbers>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "solve/radial/rest_shape.h"

using namespace arapfields;

namespace {

constexpr Index places = 6000, vertices = 600000;
constexpr double rough = 0.02;
/// Of the processor time of it all, that a cancel may wait: without a look it is 1.
constexpr double longest_share = 0.6;

/// A ball on a spiral, and a mesh that scatters about it.
SurfaceSamples rough_ball() {
  SurfaceSamples samples;
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  const auto on_ball = [&](Index i, Index count) -> Vec3 {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count);
    const double r = std::sqrt(1.0 - z * z), angle = golden * static_cast<double>(i);
    return {r * std::cos(angle), r * std::sin(angle), z};
  };
  samples.points.resize(places, 3);
  for (Index i = 0; i < places; ++i) samples.points.row(i) = 0.8 * on_ball(i, places).transpose();
  samples.normals = samples.points / 0.8;
  TriangleMesh mesh{Points(vertices, 3), Triangles(vertices / 3, 3)};
  Random random(5);
  for (Index i = 0; i < vertices; ++i)
    mesh.vertices.row(i) = (0.8 + rough * random.uniform()) * on_ball(i, vertices).transpose();
  for (Index i = 0; i < vertices; ++i) mesh.triangles(i / 3, i % 3) = static_cast<Triangles::Scalar>(i);
  samples.mesh = std::make_shared<const TriangleMesh>(std::move(mesh));
  return samples;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(followed_places)

BOOST_AUTO_TEST_CASE(solvers_on_one_shape_share_them_and_a_cancel_is_heard) {
  const SurfaceSamples samples = rough_ball();
  const RestShape shape(samples, false, 0, Progress());
  const ThreadScope threads(1);
  std::clock_t last = 0, longest = 0;
  const auto look = [&] {
    const std::clock_t now = std::clock();
    longest = std::max(longest, now - std::exchange(last, now));
    return false;
  };
  const Progress::Interruption interruption = look, at_once = [] { return true; };
  Task task, cancelled;
  BOOST_CHECK_THROW(shape.followed(samples, Progress(&cancelled, 0.0, 1.0, &at_once)), Cancelled);
  const std::clock_t begin = last = std::clock();
  const auto first = shape.followed(samples, Progress(&task, 0.0, 1.0, &interruption));
  look();
  BOOST_CHECK_LT(static_cast<double>(longest), longest_share * static_cast<double>(last - begin));
  BOOST_CHECK_GT(first->rest.rows(), places);  // some stand out
  BOOST_CHECK_EQUAL(first->rest.rows() - places, std::ssize(first->parents));
  BOOST_CHECK(shape.followed(samples, {}) == first);
}

BOOST_AUTO_TEST_SUITE_END()
