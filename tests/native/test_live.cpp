// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/random.h"
#include "core/tall_product.h"
#include "fields/radial_evaluator.h"
#include "optimize/quasi_newton.h"
#include "sampling/facing_runs.h"
#include "tensors/dense.h"

using namespace arapfields;

namespace {

Points random_points(Index count, std::uint64_t seed) {
  Random random(seed);
  Points points(count, 3);
  for (Index i = 0; i < count; ++i) points.row(i) = random.direction().transpose() * random.uniform(0.5, 0.7);
  return points;
}

RowMatrix<double> random_matrix(Index rows, Index cols, std::uint64_t seed) {
  Random random(seed);
  RowMatrix<double> result(rows, cols);
  for (Index i = 0; i < result.size(); ++i) result.data()[i] = random.normal();
  return result;
}

/// Σ (u_i⁴/4 + u_i²/2 − b_i u_i), u = A c: convex, far from quadratic.
class Quartic : public MeasuredObjective {
 public:
  explicit Quartic(Index n) : a_(random_matrix(2 * n, n, 3)), b_(random_matrix(6 * n, 1, 4) * 20.0) {}
  void measure(const RowMatrix<double>& c, Vector& u) const override {
    const RowMatrix<double> product = a_ * c;
    u = Eigen::Map<const Vector>(product.data(), product.size());
  }
  double value(const Vector& u, Vector* cotangents) const override {
    if (cotangents != nullptr) *cotangents = u.array().cube().matrix() + u - b_;
    return u.array().pow(4).sum() / 4 + u.squaredNorm() / 2 - b_.dot(u);
  }
  RowMatrix<double> pull_back(const Vector& x) const override {
    return a_.transpose() * Eigen::Map<const RowMatrix<double>>(x.data(), a_.rows(), 3);
  }
  RowMatrix<double> precondition(const RowMatrix<double>& g) const override { return g * 0.01; }

 private:
  RowMatrix<double> a_;
  Vector b_;
};

}  // namespace

BOOST_AUTO_TEST_SUITE(live)

BOOST_AUTO_TEST_CASE(farthest_points_spread_and_stop_at_duplicates) {
  const Points points = random_points(500, 1);
  const FarthestPoints few = farthest_points(points, 10), more = farthest_points(points, 100);
  BOOST_TEST(more.fill_distance < few.fill_distance);
  for (Index i = 0; i < points.rows(); ++i) {
    double nearest = 1e9;
    for (const Index j : more.indices) nearest = std::min(nearest, (points.row(i) - points.row(j)).norm());
    BOOST_TEST(nearest <= more.fill_distance + 1e-12);
  }
  BOOST_TEST(farthest_points(Points::Ones(40, 3), 7).indices.size() == 1u);
  BOOST_CHECK_THROW(farthest_points(Points(0, 3), 7), InvalidInput);
}

template <class Scalar>
void check_evaluator(double tolerance) {
  const Points points = random_points(77, 5);
  const RadialBasis basis = radial_basis(random_points(400, 6), {{10, 1.5}, {60, 2.0}});
  const RadialEvaluator<Scalar> sites(basis, points);
  const RowMatrix<double> c = random_matrix(basis.size(), 3, 7);
  for (const JetOrder order : {JetOrder::value, JetOrder::first, JetOrder::second}) {
    JetBlock<Scalar> jets(points.rows(), order);
    sites.evaluate(c, jets.view());
    const Index size = columns(order) * points.rows();
    const RowMatrix<double> found =
        Eigen::Map<const RowMatrix<Scalar>>(jets.view().data, size, 3).template cast<double>();
    const RowMatrix<double> rows = radial_rows(basis, points, order);
    BOOST_TEST((rows * c - found).norm() < tolerance * found.norm());
    const std::vector<Index> blocks{1, 4};
    JetBlock<Scalar> some(points.rows(), order);
    sites.evaluate(c, some.view(), &blocks);
    for (Index p = 0; p < points.rows(); ++p)
      BOOST_TEST(*some.view().at(0, p) == (p / 16 == 1 || p / 16 == 4 ? *jets.view().at(0, p) : Scalar(0)));
    const RowMatrix<Scalar> cotangents = random_matrix(size, 3, 8).cast<Scalar>();
    RowMatrix<double> gradient = RowMatrix<double>::Zero(basis.size(), 3);
    sites.pull_back({cotangents.data(), points.rows(), order}, gradient);
    const RowMatrix<double> expected = rows.transpose() * cotangents.template cast<double>();
    BOOST_TEST((expected - gradient).norm() < tolerance * gradient.norm());
  }
}

BOOST_AUTO_TEST_CASE(evaluators_agree_with_their_rows_and_pull_back_is_the_transpose) {
  check_evaluator<double>(1e-11);
  check_evaluator<float>(1e-5);
}

/// `like`: rest coordinates are the places themselves, so that runs are compact in both. `band`: relative
/// width of the band around the limits in which rounding may decide; of few pairs none is in it.
void check_runs(Index n, bool like, double far, double band) {
  const double near = 0.4, facing = -0.1;
  const Points places = random_points(n, 15);
  RowMatrix<double> rest = random_matrix(n, 8, 14);
  if (like) {
    rest.setZero();
    rest.leftCols(3) = places;
  }
  const Points known = Points(random_matrix(n, 3, 16)).rowwise().normalized();
  Eigen::Array<bool, Eigen::Dynamic, 1> open(n);
  for (Index i = 0; i < n; ++i) open[i] = i % 5 != 0;
  const FacingRuns runs(rest, far);
  for (const Points& normals : {Points(0, 3), known}) {
    const auto met = runs.meeting(places, normals, open, near, facing);
    Index found = 0, wrong = 0;
    for (Index a = 0; a < runs.count(); ++a)
      for (Index b = 0; b < runs.count(); ++b) {
        bool meets = false, may_meet = false;  // within the limits, and within slightly wider ones
        for (const Index i : runs.samples(a))
          for (const Index j : runs.samples(b)) {
            const double gap = (places.row(i) - places.row(j)).norm();
            const double apart = (rest.row(i) - rest.row(j)).norm();
            const double cosine = normals.rows() == 0 ? -1.0 : normals.row(i).dot(normals.row(j));
            const auto within = [&](double by) {
              return open[i] && open[j] && gap < (1.0 + by) * near && apart > (1.0 - by) * far &&
                     cosine <= facing + by;
            };
            meets = meets || within(0.0);
            may_meet = may_meet || within(band);
          }
        const auto& of = met[static_cast<std::size_t>(a)];
        const auto times = std::count(of.begin(), of.end(), b);
        wrong += times > (may_meet ? 1 : 0) || times < (meets ? 1 : 0);
        found += meets;
      }
    BOOST_TEST(wrong == 0);
    BOOST_TEST((found > 0 || n < 10));
    BOOST_TEST(found < runs.count() * runs.count());
  }
}

BOOST_AUTO_TEST_CASE(runs_meet_where_their_samples_do) {
  for (const bool like : {false, true}) {
    for (const Index n : {1, 14, 78}) check_runs(n, like, like ? 0.2 : 3.0, 0.0);
    check_runs(600, like, like ? 0.35 : 3.0, 1e-3);
  }
}

BOOST_AUTO_TEST_CASE(tall_products_agree_with_eigen) {
  for (const Index n : {1, 5, 64, 131}) {
    const RowMatrix<double> a = random_matrix(n + 3, n, 9), square = random_matrix(n, n, 10);
    const Points b = random_matrix(n, 3, 11), c = random_matrix(n + 3, 3, 12);
    const TallMatrix<double> whole(a), lower(square, true);
    BOOST_TEST((whole.times(b) - a * b).norm() < 1e-11);
    BOOST_TEST((whole.transpose_times(c) - a.transpose() * c).norm() < 1e-11);
    const RowMatrix<double> triangle = square.triangularView<Eigen::Lower>();
    BOOST_TEST((lower.times(b) - triangle * b).norm() < 1e-11);
    BOOST_TEST((lower.transpose_times(b) - triangle.transpose() * b).norm() < 1e-11);
    const RowMatrix<double> solid = triangle + 20.0 * RowMatrix<double>::Identity(n, n);
    BOOST_TEST((lower_inverse<double>(solid) * solid - RowMatrix<double>::Identity(n, n)).norm() < 1e-11);
  }
}

BOOST_AUTO_TEST_CASE(quasi_newton_descends_to_the_minimum_and_stays) {
  const Quartic objective(20);
  RowMatrix<double> c = RowMatrix<double>::Zero(20, 3);
  QuasiNewton optimizer;
  double last = 0.0;
  for (int i = 0; i < 60; ++i) {
    const QuasiNewtonReport report = optimizer.minimise(objective, {1, 1e-15}, c);
    BOOST_TEST(report.value <= last);
    last = report.value;
  }
  Vector u, cotangents;
  objective.measure(c, u);
  objective.value(u, &cotangents);
  BOOST_TEST(objective.pull_back(cotangents).norm() < 1e-3);
  const RowMatrix<double> before = c;
  BOOST_TEST(optimizer.minimise(objective, {5, 1e-6}, c).iterations == 0);
  BOOST_TEST((before - c).norm() == 0.0);
  c(0, 0) = std::nan("");
  BOOST_CHECK_THROW(optimizer.minimise(objective, {}, c), Diverged);
}

BOOST_AUTO_TEST_SUITE_END()
