// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "implicit_shapes.h"
#include "sampling/crossings.h"
#include "sampling/sample_surface.h"
#include "sampling/standing_out.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(sampling)

namespace {

// χ² of equally probable bins, as (χ² − dof) / sqrt(2 dof): for 20,000 points and 64 or more bins nearly
// standard normal. 3.1 is the one-sided 0.1 % point; seeds are fixed.
constexpr double chi_square_limit = 3.1;
constexpr Index uniformity_count = 20000;

double chi_square(const std::vector<Index>& bins) {
  double total = 0.0, sum = 0.0;
  for (const Index each : bins) total += static_cast<double>(each);
  const double expected = total / static_cast<double>(bins.size());
  for (const Index each : bins) sum += std::pow(static_cast<double>(each) - expected, 2) / expected;
  const double freedom = static_cast<double>(bins.size()) - 1.0;
  return (sum - freedom) / std::sqrt(2.0 * freedom);
}

int bin(double fraction, int bins) { return std::clamp(static_cast<int>(fraction * bins), 0, bins - 1); }

double turn(double y, double x) { return std::atan2(y, x) / (2.0 * std::numbers::pi) + 0.5; }

SurfaceSamples sample(const ImplicitFunction& function, int count, std::int64_t seed = 1,
                      SampleReport* report = nullptr) {
  return sample_surface(function, {.count = count, .seed = seed}, {}, report);
}

void check_on_surface(const shapes::Analytic& shape, const SurfaceSamples& samples) {
  double worst = 0.0;
  for (Index i = 0; i < samples.size(); ++i)
    worst = std::max(worst, std::abs(shape(samples.points.row(i).transpose())));
  BOOST_TEST(worst <= 1e-4);
  BOOST_TEST((samples.normals.rowwise().norm().array() - 1.0).abs().maxCoeff() < 1e-9);
}

}  // namespace

BOOST_AUTO_TEST_CASE(lines_meet_planes_of_every_direction_equally_often) {
  // Crofton: a disk of area A inside the box is met by 2 A / area() of the lines, however it is turned.
  const Box box{Vec3(-1, -0.5, -0.8), Vec3(0.7, 0.9, 0.6)};
  Random random(3);
  const Index count = 200000;
  const double radius = 0.4, expected = 2.0 * std::numbers::pi * radius * radius / box.area();
  const Vec3 center(-0.2, 0.1, -0.1), normals[] = {Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(1, 1, 1).normalized()};
  Index hits[3] = {0, 0, 0};
  for (Index i = 0; i < count; ++i) {
    const Line line = random_line(box, random);
    BOOST_REQUIRE(((line.at(line.length) - box.low).array() > -1e-9).all());
    BOOST_REQUIRE(((box.high - line.at(line.length)).array() > -1e-9).all());
    for (int k = 0; k < 3; ++k) {
      const double t = (center - line.origin).dot(normals[k]) / line.direction.dot(normals[k]);
      hits[k] += (line.at(t) - center).norm() < radius;
    }
  }
  const double deviation = std::sqrt(expected * (1.0 - expected) / static_cast<double>(count));
  for (const Index each : hits)
    BOOST_TEST(std::abs(static_cast<double>(each) / static_cast<double>(count) - expected) < 4.0 * deviation);
}

BOOST_AUTO_TEST_CASE(uniform_on_a_sphere) {
  const auto shape = shapes::sphere(0.6, Vec3(0.1, -0.2, 0.15));
  SampleReport report;
  const SurfaceSamples samples = sample(shape, uniformity_count, 1, &report);
  BOOST_REQUIRE(samples.size() == uniformity_count);
  check_on_surface(shape, samples);
  std::vector<Index> bins(12 * 24, 0);  // equal areas: z and longitude
  for (Index i = 0; i < samples.size(); ++i) {
    const Vec3 x = (samples.points.row(i).transpose() - Vec3(0.1, -0.2, 0.15)) / 0.6;
    ++bins[static_cast<std::size_t>(bin(0.5 + 0.5 * x[2], 12) * 24 + bin(turn(x[1], x[0]), 24))];
    BOOST_REQUIRE((samples.normals.row(i).transpose() - x).norm() < 1e-2);
  }
  BOOST_TEST(chi_square(bins) < chi_square_limit);
  BOOST_TEST(report.value_evaluations + report.gradient_evaluations < 10 * uniformity_count);
}

BOOST_AUTO_TEST_CASE(uniform_on_a_box) {
  const Vec3 half(0.7, 0.5, 0.35);
  const auto shape = shapes::box(half);
  const SurfaceSamples samples = sample(shape, uniformity_count);
  check_on_surface(shape, samples);
  // Every face is cut into patches; expected counts go by area, so bins are weighted to one size by 5 × 5
  // patches a face and a comparison face by face and patch by patch.
  const double total = 8.0 * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0]);
  double sum = 0.0;
  std::vector<Index> bins(6 * 25, 0);
  for (Index i = 0; i < samples.size(); ++i) {
    const Vec3 x = samples.points.row(i).transpose().cwiseQuotient(half);
    Index axis = 0;
    x.cwiseAbs().maxCoeff(&axis);
    const Index u = (axis + 1) % 3, v = (axis + 2) % 3;
    const Index face = 2 * axis + (x[axis] > 0.0 ? 1 : 0);
    ++bins[static_cast<std::size_t>(25 * face + 5 * bin(0.5 + 0.5 * x[u], 5) + bin(0.5 + 0.5 * x[v], 5))];
  }
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const std::size_t axis = i / 50;
    const double area = 4.0 * half[(axis + 1) % 3] * half[(axis + 2) % 3] / 25.0;
    const double expected = uniformity_count * area / total;
    sum += std::pow(static_cast<double>(bins[i]) - expected, 2) / expected;
  }
  BOOST_TEST((sum - 149.0) / std::sqrt(2.0 * 149.0) < chi_square_limit);
}

BOOST_AUTO_TEST_CASE(uniform_on_a_torus) {
  const double major = 0.55, minor = 0.25;
  const auto shape = shapes::torus(major, minor);
  const SurfaceSamples samples = sample(shape, uniformity_count);
  check_on_surface(shape, samples);
  std::vector<Index> bins(16 * 16, 0);
  for (Index i = 0; i < samples.size(); ++i) {
    const Vec3 x = samples.points.row(i).transpose();
    // Area up to the tube's angle φ: φ major + sin φ minor, of 2π major.
    const double phi = std::atan2(x[2], std::hypot(x[0], x[1]) - major);
    const double fraction = 0.5 + (phi * major + std::sin(phi) * minor) / (2.0 * std::numbers::pi * major);
    ++bins[static_cast<std::size_t>(16 * bin(fraction, 16) + bin(turn(x[1], x[0]), 16))];
  }
  BOOST_TEST(chi_square(bins) < chi_square_limit);
}

BOOST_AUTO_TEST_CASE(every_crossing_is_found) {
  // Against small steps along the same lines. The last two shapes have thin walls: lines cross them twice
  // within 0.02 and 0.008. Two crossings closer than 1e-3 (lines that clip a crease) may be missed.
  constexpr double closest = 1e-3;
  const shapes::Analytic all[] = {shapes::sphere(0.6), shapes::torus(0.5, 0.1), shapes::ball_and_box(),
                                  shapes::box(Vec3(0.8, 0.6, 0.004)), shapes::Analytic([](const Vec3& x) {
                                    return std::abs(x.norm() - 0.6) - 0.01;
                                  })};
  for (const auto& shape : all) {
    EvaluationCounter function(shape, Progress());
    const TricubicSurrogate model(function, {});
    std::vector<Line> lines(1500);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      Random random(5, i);
      lines[i] = random_line(model.bounds(), random);
    }
    ScanResult found = scan_lines(model, lines);
    const auto settled = resolve_ambiguous(function, model, lines, found.ambiguous);
    found.brackets.insert(found.brackets.end(), settled.begin(), settled.end());
    std::vector<Index> counts(lines.size(), 0);
    for (const Bracket& each : found.brackets) ++counts[static_cast<std::size_t>(each.line)];
    Index crossings = 0, wrong = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::vector<double> where;
      double before = shape(lines[i].at(0.0));
      for (double t = 0.0; t < lines[i].length;) {
        t = std::min(lines[i].length, t + std::max(5e-5, 0.5 * std::abs(before)));  // slopes are at most 1
        const double value = shape(lines[i].at(t));
        if ((before < 0.0) != (value < 0.0)) where.push_back(t);
        before = value;
      }
      Index close = 0;
      for (std::size_t k = 0; k + 1 < where.size(); ++k) close += where[k + 1] - where[k] < closest;
      const auto expected = static_cast<Index>(where.size());
      crossings += expected;
      wrong += counts[i] > expected || counts[i] < expected - 2 * close;
    }
    BOOST_TEST(crossings > 400);
    BOOST_TEST(wrong == 0);
    const Crossings points = find_crossings(function, lines, found.brackets, 2e-6);
    BOOST_TEST(points.failed.size() == 0u);
    BOOST_TEST(points.largest < 1e-5);
  }
}

BOOST_AUTO_TEST_CASE(the_bound_holds_where_the_function_is_steep_in_places) {
  // Nine tenths of the cube are flat, a shell around the surface is three times as steep.
  const shapes::Analytic steep([](const Vec3& x) {
    const double d = x.norm() - 0.5;
    return d + 2.0 * std::clamp(d, -0.05, 0.05);
  });
  SampleReport report;
  check_on_surface(steep, sample(steep, 5000, 1, &report));
  BOOST_TEST(report.lipschitz > 3.0);
}

BOOST_AUTO_TEST_CASE(small_and_boundary_surfaces) {
  check_on_surface(shapes::sphere(0.02, Vec3(0.3, 0.3, 0.3)),
                   sample(shapes::sphere(0.02, Vec3(0.3, 0.3, 0.3)), 500));
  const shapes::Analytic cut = shapes::sphere(0.8, Vec3(0.9, 0, 0));  // leaves the cube
  const SurfaceSamples samples = sample(cut, 4000);
  check_on_surface(cut, samples);
  BOOST_TEST(samples.points.cwiseAbs().maxCoeff() <= 1.0 + 1e-6);
  // The cap x ≤ 1 of the sphere has height 0.9 of its 1.6; area goes by height (Archimedes), so x is uniform.
  BOOST_TEST(std::abs(samples.points.col(0).mean() - 0.55) < 4.0 * 0.9 / std::sqrt(12.0 * 4000.0));
}

BOOST_AUTO_TEST_CASE(seeds_and_threads) {
  const auto shape = shapes::torus(0.5, 0.2);
  const SurfaceSamples a = sample(shape, 3000, 7), other = sample(shape, 3000, 8);
  SurfaceSamples b;
  {
    const ThreadScope one(1);
    b = sample(shape, 3000, 7);
  }
  BOOST_TEST((a.points == b.points));
  BOOST_TEST((a.normals == b.normals));
  BOOST_TEST((a.points - other.points).norm() > 1.0);
}

BOOST_AUTO_TEST_CASE(bad_sampling_input) {
  const auto shape = shapes::sphere(0.5);
  BOOST_CHECK_THROW(sample(shape, 0), InvalidInput);
  BOOST_CHECK_THROW(sample_surface(shape, {.count = 10, .tolerance = 0.0}), InvalidInput);
  const shapes::Analytic nothing([](const Vec3& x) { return x.squaredNorm() + 0.5; });
  BOOST_CHECK_THROW(sample(nothing, 10), InvalidInput);
  const shapes::Analytic touching([](const Vec3& x) { return x.squaredNorm() + 1e-3; });
  BOOST_CHECK_THROW(sample(touching, 10), InvalidInput);
  const shapes::Analytic broken([](const Vec3& x) { return std::sqrt(x[0]); });
  BOOST_CHECK_THROW(sample(broken, 10), InvalidInput);
  Task task;
  task.cancel();
  BOOST_CHECK_THROW(sample_surface(shape, {}, Progress(&task)), Cancelled);
}

BOOST_AUTO_TEST_SUITE(standing_out_of_samples)

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

BOOST_AUTO_TEST_SUITE_END()
