// SPDX-License-Identifier: GPL-3.0-or-later
// The live solver and its threads, and what several of them read; the thread sanitizer runs these.
#include <atomic>
#include <boost/test/unit_test.hpp>
#include <functional>
#include <stdexcept>
#include <thread>

#include "attach/attachment.h"
#include "core/errors.h"
#include "core/one_at_a_time.h"
#include "core/parallel.h"
#include "core/random.h"
#include "distance/mesh_sdf.h"
#include "energies/object_style.h"
#include "fields/apply_field.h"
#include "fields/inverse.h"
#include "fields/neural_field.h"
#include "mesh/sample_mesh.h"
#include "shapes.h"
#include "skin/skin_weights.h"
#include "skin/skinning.h"
#include "solve/radial/radial_solver.h"
#include "solve/radial/rest_shape.h"
#include "splats/move_splats.h"
#include "wrap/sequence.h"
#include "wrap/transfer.h"

using namespace arapfields;

namespace {

constexpr int frames = 6;

SurfaceSamples ball(Index count) {
  Random random(11);
  SurfaceSamples samples;
  samples.points.resize(count, 3);
  for (Index i = 0; i < count; ++i) samples.points.row(i) = 0.6 * random.direction().transpose();
  samples.normals = samples.points.rowwise().normalized();
  return samples;
}

Handle point(const Vec3& rest, const Vec3& target) {
  Handle handle;
  handle.kind = Handle::Kind::point;
  handle.rest_point = rest;
  handle.target_point = target;
  return handle;
}

std::vector<Handle> pose(double turn) {
  return {point({0, 0, -0.6}, {0, 0, -0.6}),
          point({0, 0, 0.6}, {0.6 * std::sin(turn), 0, 0.6 * std::cos(turn)})};
}

LiveOptions small_options(int threads) {
  LiveOptions options;
  options.samples = 400;
  options.coarse_centers = 12;
  options.fine_centers = 40;
  options.iterations = 3;
  options.threads = threads;
  return options;
}

/// Where a drag over some frames takes the points.
PointsF dragged(const SurfaceSamples& samples, int threads) {
  RadialSolver live(samples, pose(0.0), small_options(threads));
  live.track(samples.points);
  for (int frame = 1; frame <= frames; ++frame) {
    live.set_targets(pose(0.1 * frame));
    live.solve();
  }
  return live.tracked();
}

GaussianSplats splats_at(const Points& points) {
  const Index n = points.rows();
  GaussianSplats splats;
  splats.centers = points.cast<float>();
  splats.rotations = RowMatrix<float>::Zero(n, 4);
  splats.rotations.col(0).setOnes();
  splats.log_scales = PointsF::Constant(n, 3, -4.0f);
  splats.opacity_logits = VectorF::Zero(n);
  splats.harmonics = RowMatrix<float>::Zero(n, 3);
  splats.other_values.resize(n, 0);
  return splats;
}

/// Every answer is the one that it is alone, where three threads ask at once.
void ask_at_once(const std::vector<std::function<RowMatrix<double>()>>& calls) {
  std::vector<RowMatrix<double>> alone;
  for (const auto& call : calls) alone.push_back(call());
  std::atomic<int> wrong{0};
  std::vector<std::thread> callers;
  for (std::size_t first = 0; first < 3; ++first)
    callers.emplace_back([&, first] {
      for (std::size_t k = 0; k < 60; ++k) {
        const std::size_t which = (first * calls.size() / 3 + k) % calls.size();
        wrong += calls[which]() != alone[which];
      }
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK_EQUAL(wrong, 0);
}

/// Two meshes, which a drag takes onto each other and onto what is below.
SurfaceSamples two_balls() {
  SurfaceSamples one = ball(500), two = one;
  one.points.col(0).array() -= 0.7;
  two.points.col(0).array() += 0.7;
  for (SurfaceSamples* some : {&one, &two}) some->points *= 0.5;
  SurfaceSamples both = ball(1000);
  both.points << one.points, two.points;
  both.normals << one.normals, two.normals;
  both.mesh_indices.assign(500, 0);
  both.mesh_indices.resize(1000, 1);
  return both;
}

std::vector<Handle> pressing(double share) {
  return {point({-0.35, 0, 0.3}, {-0.35 + 0.3 * share, 0, 0.3 - 0.1 * share}),
          point({0.35, 0, 0.3}, {0.35 - 0.3 * share, 0, 0.3 - 0.1 * share})};
}

/// A ring behind one ball, an open tube behind the other, the ground, and the balls themselves.
Contact all_about() {
  TriangleMesh ring = shapes::torus(16, 10, 0.3, 0.1), tube = shapes::torus(16, 10, 0.3, 0.25);
  tube.triangles = tube.triangles.topRows(tube.triangles.rows() / 2).eval();
  Contact contact;
  for (const auto& [mesh, x] : {std::pair(ring, -0.35), std::pair(tube, 0.35)}) {
    Obstacle obstacle{std::make_shared<MeshSdf>(mesh.vertices, mesh.triangles)};
    obstacle.placement.topRightCorner<3, 1>() = Vec3(x, 0.0, -0.55);
    contact.obstacles.push_back(obstacle);
  }
  contact.ground = -0.4;
  contact.itself = true;
  return contact;
}

/// Where a drag with contact and a fall after it take the points; adds to `held` the handles that give way in
/// each frame.
PointsF pressed(const SurfaceSamples& samples, const Contact& contact, std::shared_ptr<const RestShape> shape,
                int threads, std::ptrdiff_t& held) {
  LiveOptions options = small_options(threads);
  options.iterations = 12;
  RadialSolver live(samples, pressing(0.0), options, {}, std::move(shape));
  live.set_contact(contact);
  live.track(samples.points);
  const auto count = [&] { held += std::ssize(live.report().contact.held); };
  for (int frame = 1; frame <= frames; ++frame) {
    live.set_targets(pressing(static_cast<double>(frame) / frames));
    live.solve();
    count();
  }
  SecondaryMotion falling;
  falling.options.gravity = 10.0;
  live.set_secondary_motion(falling);
  for (int frame = 0; frame < frames; ++frame) {
    live.step(pressing(1.0), 0.04);
    count();
  }
  return live.tracked();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(live_threads)

BOOST_AUTO_TEST_CASE(solvers_at_once_do_not_know_of_each_other) {
  const SurfaceSamples samples = ball(600);
  const PointsF alone = dragged(samples, 1);
  BOOST_CHECK((alone - samples.points.cast<float>()).norm() > 0.1f);
  std::atomic<int> same{0};
  std::vector<std::thread> callers;
  for (const int threads : {1, 2, 3})
    callers.emplace_back([&, threads] { same += dragged(samples, threads) == alone; });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK_EQUAL(same, 3);
}

BOOST_AUTO_TEST_CASE(solvers_at_once_share_obstacles_and_rest_shape) {
  const SurfaceSamples samples = two_balls();
  const Contact contact = all_about();
  const LiveOptions options = small_options(1);
  const auto shape = std::make_shared<const RestShape>(samples, options.interior, 0, Progress());
  std::ptrdiff_t held = 0;
  const PointsF alone = pressed(samples, contact, shape, 1, held);
  BOOST_CHECK_GT(held, 0);
  std::atomic<int> same{0};
  std::vector<std::thread> callers;
  for (const int threads : {1, 2, 3})
    callers.emplace_back([&, threads] {
      std::ptrdiff_t held_here = 0;
      same += pressed(samples, contact, shape, threads, held_here) == alone && held_here == held;
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK_EQUAL(same, 3);
}

BOOST_AUTO_TEST_CASE(a_solve_is_watched_and_cancelled_from_another_thread) {
  const SurfaceSamples samples = ball(600);
  RadialSolver live(samples, pose(0.0), small_options(2));
  live.set_targets(pose(0.8));
  Task task;
  std::atomic<bool> ended{false}, monotone{true};
  std::thread watcher([&] {
    double seen = 0.0;
    while (!ended && task.progress() < 0.2) {
      const double now = task.progress();
      if (now < seen) monotone = false;
      seen = now;
      task.message();
    }
    task.cancel();
  });
  bool cancelled = false;
  try {
    for (int round = 0; round < 200; ++round) live.solve(50, 1e-12, Progress(&task));
  } catch (const Cancelled&) {
    cancelled = true;
  }
  ended = true;
  watcher.join();
  BOOST_CHECK(cancelled);
  BOOST_CHECK(monotone);
  BOOST_CHECK(live.solve()->at(samples.points).allFinite());
}

BOOST_AUTO_TEST_CASE(one_solver_serves_threads_one_at_a_time) {
  const SurfaceSamples samples = ball(600);
  OneAtATime<RadialSolver> live(samples, pose(0.0), small_options(2));
  live.run({}, [&](RadialSolver& solver) { solver.track(samples.points); });
  Contact on_the_ground;
  on_the_ground.ground = -0.65;
  on_the_ground.itself = true;
  const std::vector<std::function<void(RadialSolver&)>> calls = {
      [](RadialSolver& solver) { solver.set_targets(pose(0.3)), solver.solve(); },
      [](RadialSolver& solver) { solver.set_targets(pose(-0.3)), solver.follow(); },
      [](RadialSolver& solver) { solver.step(pose(0.2), 0.04); },
      [](RadialSolver& solver) { BOOST_CHECK(solver.tracked().allFinite()); },
      [](RadialSolver& solver) { BOOST_CHECK(std::isfinite(solver.report().value)); },
      [](RadialSolver& solver) { solver.set_motion_state(solver.motion_state()); },
      [](RadialSolver& solver) { solver.set_secondary_motion(SecondaryMotion{}); },
      [](RadialSolver& solver) { solver.set_handles(pose(0.0)); },
      [&](RadialSolver& solver) { solver.set_contact(on_the_ground); },
      [](RadialSolver& solver) { solver.set_weights(Vector::Constant(600, 2.0)); },
      [](RadialSolver& solver) { solver.reset(); }};
  std::vector<std::thread> callers;
  for (std::size_t first = 0; first < 3; ++first)
    callers.emplace_back([&, first] {
      for (std::size_t k = 0; k < 2 * calls.size(); ++k)
        live.run({}, calls[(first + (2 * first + 1) * k) % calls.size()]);
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK_THROW(live.run({}, [&](RadialSolver&) { live.run({}, [](RadialSolver&) {}); }),
                    std::runtime_error);
  Task task;
  task.cancel();
  live.run({}, [&](RadialSolver&) {
    std::thread waiting(
        [&] { BOOST_CHECK_THROW(live.run(Progress(&task), [](RadialSolver&) {}), Cancelled); });
    waiting.join();
  });
}

BOOST_AUTO_TEST_CASE(one_sequence_serves_threads_one_at_a_time) {
  const auto ring = [](double major) { return shapes::torus(16, 10, major); };
  const SurfaceSamples samples = sample_mesh(ring(1.0).vertices, ring(1.0).triangles, 400, 1);
  const MeshSdf first(ring(1.05).vertices, ring(1.05).triangles),
      next(ring(1.1).vertices, ring(1.1).triangles);
  WrapOptions options;
  options.centers = 40, options.stages = 2, options.iterations = 2;
  WrapSequence sequence(samples, *wrap(samples, first, {}, options).field, options);
  const Points start = sequence.state();
  const Points alone = sequence.next(next).field->at(samples.points);
  std::atomic<int> finite{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 3; ++caller)
    callers.emplace_back([&] {
      sequence.set_state(start);
      finite += sequence.field()->at(samples.points).allFinite();
      finite += sequence.next(next).field->at(samples.points).allFinite();
      finite += sequence.state().allFinite();
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK_EQUAL(finite, 9);
  sequence.set_state(start);
  BOOST_CHECK(sequence.next(next).field->at(samples.points) == alone);
}

BOOST_AUTO_TEST_CASE(objects_answer_threads_at_once) {
  const SurfaceSamples samples = ball(600);
  RadialSolver live(samples, pose(0.0), small_options(1));
  live.set_targets(pose(0.3));
  const RadialField field = *live.solve();
  MlpShape shape;
  shape.outputs = 3, shape.width = 8, shape.layers = 1;
  const NeuralField network(shape, 1);
  const TriangleMesh torus = shapes::torus(12, 8);
  const MeshSdf distance(torus.vertices, torus.triangles);
  const ObjectStyle style(torus.vertices, torus.triangles);
  const Correspondence places(WrappedMesh(torus, field), torus, Correspondence::Direction::to_target);
  const Attachment attached(samples, 1.5 * samples.points.topRows(40));
  const NewtonInverse inverse(field, samples.points);
  const PreparedSplats splats(splats_at(samples.points));
  const std::vector<Bone> bones = {{Vec3(-1, 0, 0), Vec3(0, 1, 0)}, {Vec3(1, 0, 0), Vec3(0, -1, 0)}};
  SkinOptions skinning;
  skinning.samples = 400, skinning.poses = 3;
  const RowMatrix<float> weights = RowMatrix<float>::Constant(torus.vertices.rows(), 2, 0.5f);
  const std::vector<Mat4> motions = {Mat4::Identity(), bone_box(bones[1])};
  const Points points = samples.points.topRows(60);
  const std::vector<std::function<RowMatrix<double>()>> calls = {
      [&] { return RowMatrix<double>(field.at(points)); },
      [&] { return network.at(points); },
      [&] { return inverse(points).points; },
      [&] { return apply_field(field, points, 0.5); },
      [&] { return attached.positions(field); },
      [&] { return distance.distances(points); },
      [&] { return distance.gradients(points); },
      [&] { return style.normals(points, 0.1); },
      [&] { return places.displacements(torus.vertices); },
      [&] { return RowMatrix<double>(splats.moved(field).centers.cast<double>()); },
      [&] { return RowMatrix<double>(skin_weights(torus, bones, skinning).cast<double>()); },
      [&] { return skin(torus.vertices, weights, motions); }};
  ask_at_once(calls);
}

/// Of fields of two bases in turn. Calls that share loops would order those behind, and hide them from the
/// sanitizer.
BOOST_AUTO_TEST_CASE(caches_are_filled_by_threads_at_once) {
  const SurfaceSamples samples = ball(600);
  LiveOptions options = small_options(1);
  RadialSolver live(samples, pose(0.0), options);
  options.fine_centers = 30;
  RadialSolver other_live(samples, pose(0.0), options);
  for (RadialSolver* solver : {&live, &other_live}) solver->set_targets(pose(0.3));
  const RadialField field = *live.solve(), other = *other_live.solve();
  const Attachment attached(samples, 1.5 * samples.points.topRows(40));
  const PreparedSplats splats(splats_at(samples.points.topRows(100)));
  const auto carried = [&](const RadialField& by) { return attached.positions(by); };
  const auto centers = [&](const RadialField& by) {
    return RowMatrix<double>(splats.moved(by).centers.cast<double>());
  };
  ask_at_once({[&] { return carried(field); }, [&] { return carried(other); }});
  ask_at_once({[&] { return centers(field); }, [&] { return centers(other); }});
}

BOOST_AUTO_TEST_SUITE_END()
