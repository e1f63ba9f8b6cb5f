// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <atomic>
#include <boost/test/unit_test.hpp>
#include <set>
#include <stdexcept>

#include "core/errors.h"
#include "core/frame.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/task.h"
#include "tensors/dense.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(core)

BOOST_AUTO_TEST_CASE(progress_maps_parts_and_never_falls) {
  Task task;
  const Progress whole(&task), second = whole.part(0.5, 1.0);
  second.report(0.5, "half of the second half");
  BOOST_TEST(task.progress() == 0.75);
  whole.report(0.1);
  BOOST_TEST(task.progress() == 0.75);
  BOOST_TEST(task.message() == "half of the second half");
  task.cancel();
  BOOST_CHECK_THROW(second.check(), Cancelled);
  BOOST_CHECK_NO_THROW(Progress().check());
}

BOOST_AUTO_TEST_CASE(random_streams_repeat_and_differ) {
  Random a(7, 1), b(7, 1), c(7, 2);
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 1000; ++i) {
    const auto bits = a.bits();
    BOOST_TEST(bits == b.bits());
    seen.insert(bits);
    seen.insert(c.bits());
  }
  BOOST_TEST(seen.size() == 2000u);
  double mean = 0, square = 0;
  for (int i = 0; i < 100000; ++i) {
    const double x = a.normal();
    mean += x / 100000;
    square += x * x / 100000;
  }
  BOOST_TEST(std::abs(mean) < 0.02);  // 6 standard errors of 100,000 normals
  BOOST_TEST(std::abs(square - 1) < 0.03);
}

BOOST_AUTO_TEST_CASE(frame_round_trip_and_motions) {
  const Points points = (Points::Random(20, 3) * 5).rowwise() + Eigen::RowVector3d(10, -3, 2);
  const Frame frame = Frame::around(points);
  const Points cube = frame.to_cube(points);
  BOOST_TEST(cube.cwiseAbs().maxCoeff() <= 0.75 + 1e-12);
  BOOST_TEST((frame.to_mesh(cube) - points).norm() < 1e-12);
  const Points balanced = Frame::balanced(points, Vector::Ones(20)).to_cube(points);
  BOOST_TEST(balanced.colwise().mean().norm() < 1e-12);
  BOOST_TEST(std::abs(balanced.squaredNorm() / 20 - gyration_in_cube * gyration_in_cube) < 1e-10);
  Mat4 motion = Mat4::Identity();
  motion.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  motion.topRightCorner<3, 1>() << 1, 2, 3;
  const Points moved = (points * motion.topLeftCorner<3, 3>().transpose()).rowwise() +
                       motion.topRightCorner<3, 1>().transpose();
  const Mat4 in_cube = frame.motion_to_cube(motion);
  const Points moved_cube = (cube * in_cube.topLeftCorner<3, 3>().transpose()).rowwise() +
                            in_cube.topRightCorner<3, 1>().transpose();
  BOOST_TEST((frame.to_mesh(moved_cube) - moved).norm() < 1e-11);
  BOOST_CHECK_THROW(Frame::around(Points::Zero(3, 3)), InvalidInput);
}

BOOST_AUTO_TEST_CASE(more_memory_than_any_machine_has_is_refused_by_name) {
  require_memory("batch", 1024.0);
  BOOST_TEST(available_memory() > 0.0);
  BOOST_CHECK_EXCEPTION(require_memory("batch", 1e18), InvalidInput, [](const InvalidInput& error) {
    return std::string(error.what()).starts_with("batch: this would take about 931322574.6 GiB");
  });
}

BOOST_AUTO_TEST_CASE(parallel_for_covers_once_and_passes_exceptions) {
  std::vector<std::atomic<int>> hits(10007);
  parallel_for(0, 10007, 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) hits[static_cast<std::size_t>(i)]++;
  });
  BOOST_TEST(std::all_of(hits.begin(), hits.end(), [](const auto& h) { return h == 1; }));
  BOOST_CHECK_THROW(parallel_for(0, 100, 1, [](Index, Index) { throw std::runtime_error("x"); }),
                    std::runtime_error);
}

BOOST_AUTO_TEST_CASE(dense_products_and_cholesky_agree_with_eigen) {
  using M = RowMatrix<double>;
  const M a = M::Random(7, 5), b = M::Random(7, 6);
  M c = M::Random(5, 6);
  const M expected = 2.0 * a.transpose() * b + 0.5 * c;
  gemm<double>(Transpose::yes, Transpose::no, 2.0, a, b, 0.5, c);
  BOOST_TEST((c - expected).norm() < 1e-13);
  const M spd = a.transpose() * a + M::Identity(5, 5), rhs = M::Random(5, 3);
  const M factor = cholesky<double>(spd);
  BOOST_TEST((spd * cholesky_solve<double>(factor, rhs) - rhs).norm() < 1e-12);
  BOOST_CHECK_THROW(cholesky<double>(-spd), InvalidInput);
}

BOOST_AUTO_TEST_SUITE_END()
