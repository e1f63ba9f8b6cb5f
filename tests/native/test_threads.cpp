// SPDX-License-Identifier: GPL-3.0-or-later
#ifndef _WIN32
#include <sys/wait.h>
#include <unistd.h>
#endif

#include <atomic>
#include <boost/test/unit_test.hpp>
#include <cfenv>
#include <chrono>
#include <functional>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>

#include "attach/attachment.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/task.h"
#include "distance/mesh_sdf.h"
#include "energies/object_style.h"
#include "fields/apply_field.h"
#include "fields/inverse.h"
#include "fields/neural_field.h"
#include "mesh/outward_triangles.h"
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

constexpr auto patience = std::chrono::seconds(60);

/// Waits for a condition that other threads bring about; whether it came.
template <class Condition>
bool comes(const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

/// Whether `threads` bodies of one loop come to run at the same time, and no more do.
bool meet(int threads, int jobs) {
  const ThreadScope scope(threads);
  std::atomic<int> inside{0}, most{0};
  std::atomic<bool> met{false};
  parallel_jobs(jobs, [&](Index) {
    const int now = ++inside;
    for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
    }
    if (now == threads) met = true;
    comes([&] { return met.load(); });
    --inside;
  });
  return met && most == threads;
}

#ifndef _WIN32
/// The exit status of a child process that runs `body`; −1 where it hangs.
template <class Body>
int in_child(const Body& body) {
  const pid_t child = fork();
  if (child == 0) _exit(body() ? 0 : 1);
  int status = 0;
  if (comes([&] { return waitpid(child, &status, WNOHANG) == child; })) return WEXITSTATUS(status);
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return -1;
}
#endif

Index sum_of_chunks(Index count) {
  std::atomic<Index> sum{0};
  parallel_for(0, count, 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) sum += i;
  });
  return sum;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(threads)

BOOST_AUTO_TEST_CASE(a_loop_runs_on_as_many_threads_as_its_scope_says) {
  for (const int count : {1, 2, 3, 8}) BOOST_CHECK(meet(count, 4 * count));
}

BOOST_AUTO_TEST_CASE(a_loop_covers_its_range_once) {
  for (const int threads : {1, 2, 5})
    for (const Index length : {0, 1, 7, 128, 129, 10007}) {
      const ThreadScope scope(threads);
      std::vector<int> seen(static_cast<std::size_t>(length), 0);
      parallel_for(3, 3 + length, 4, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) ++seen[static_cast<std::size_t>(i - 3)];
      });
      BOOST_CHECK(std::all_of(seen.begin(), seen.end(), [](int n) { return n == 1; }));
    }
}

BOOST_AUTO_TEST_CASE(chunks_do_not_depend_on_the_number_of_threads) {
  const auto chunks = [](int threads) {
    const ThreadScope scope(threads);
    std::mutex mutex;
    std::set<std::pair<Index, Index>> found;
    parallel_for(0, 100003, 16, [&](Index begin, Index end) {
      const std::lock_guard lock(mutex);
      found.emplace(begin, end);
    });
    return found;
  };
  const auto alone = chunks(1);
  BOOST_CHECK_GT(alone.size(), 16u);
  BOOST_CHECK(chunks(2) == alone && chunks(7) == alone);
}

BOOST_AUTO_TEST_CASE(all_threads_round_as_the_caller_does) {
  const ThreadScope scope(3);
  const int before = std::fegetround();
  std::atomic<int> different{0};
  std::fesetround(FE_UPWARD);
  parallel_jobs(2000, [&](Index) {
    if (std::fegetround() != FE_UPWARD) ++different;
    std::this_thread::sleep_for(std::chrono::microseconds(10));
  });
  std::fesetround(before);
  BOOST_TEST(different == 0);
}

BOOST_AUTO_TEST_CASE(slots_are_one_thread_s_at_a_time) {
  const ThreadScope scope(4);
  std::array<std::atomic<int>, 4> users{};
  std::atomic<bool> clash{false};
  parallel_jobs_in_slots(1000, [&](Index, Index slot) {
    if (users.at(static_cast<std::size_t>(slot))++ != 0) clash = true;
    std::this_thread::yield();
    --users.at(static_cast<std::size_t>(slot));
  });
  BOOST_CHECK(!clash);
}

BOOST_AUTO_TEST_CASE(loops_within_loops_stay_on_their_thread) {
  const ThreadScope scope(4);
  std::atomic<int> strayed{0}, done{0};
  parallel_jobs(16, [&](Index) {
    const ThreadScope more(8);
    if (thread_count() != 1) ++strayed;
    const auto here = std::this_thread::get_id();
    parallel_for(0, 100, 1, [&](Index begin, Index end) {
      done += static_cast<int>(end - begin);
      if (std::this_thread::get_id() != here) ++strayed;
    });
  });
  BOOST_CHECK_EQUAL(strayed, 0);
  BOOST_CHECK_EQUAL(done, 1600);
  BOOST_CHECK_EQUAL(thread_count(), 4);
}

BOOST_AUTO_TEST_CASE(an_exception_reaches_the_caller_and_ends_the_loop) {
  for (const int threads : {1, 4}) {
    const ThreadScope scope(threads);
    for (int round = 0; round < 50; ++round) {
      std::atomic<int> begun{0};
      const auto loop = [&] {
        parallel_jobs(100000, [&](Index job) {
          ++begun;
          if (job == 5) throw InvalidInput("found by a worker");
          if (job > 5) std::this_thread::sleep_for(std::chrono::microseconds(10));  // throwing takes longer
        });
      };
      BOOST_CHECK_THROW(loop(), InvalidInput);
      BOOST_CHECK_LT(begun, 100000);
    }
    BOOST_CHECK_EQUAL(sum_of_chunks(1000), 499500);
    BOOST_CHECK_EQUAL(thread_count(), threads);
  }
}

BOOST_AUTO_TEST_CASE(calls_at_once_keep_to_their_own_number_of_threads) {
  const int before = thread_count();
  std::atomic<bool> fine{true};
  std::vector<std::thread> callers;
  for (const int count : {1, 2, 3})
    callers.emplace_back([&, count] {
      for (int round = 0; round < 20; ++round)
        if (!meet(count, 2 * count)) fine = false;
    });
  for (std::thread& caller : callers) caller.join();
  BOOST_CHECK(fine);
  BOOST_CHECK_EQUAL(thread_count(), before);
  int elsewhere = 0;
  std::thread([&] { elsewhere = thread_count(); }).join();
  BOOST_CHECK_EQUAL(elsewhere, before);
}

BOOST_AUTO_TEST_CASE(a_call_ends_whenever_its_helper_does) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round < 1000; ++round) {
    std::atomic<bool> begun{false};
    thread_pool().run(1, [&](int number) {
      if (number == 0) {
        comes([&] { return begun.load(); });
        return;  // falls asleep some 20 µs later, about when the helper ends
      }
      begun = true;
      const Clock::time_point end = Clock::now() + std::chrono::microseconds(15 + round % 20);
      while (Clock::now() < end) {
      }
    });
    BOOST_REQUIRE(begun);
  }
}

BOOST_AUTO_TEST_CASE(more_threads_than_the_pool_has_are_done_without) {
  const ThreadScope scope(1024);
  BOOST_CHECK_EQUAL(thread_count(), ThreadPool::most_workers + 1);
  BOOST_CHECK_EQUAL(sum_of_chunks(100000), 4999950000);
}

#ifndef _WIN32  // which has no fork()
BOOST_AUTO_TEST_CASE(a_forked_child_works, *boost::unit_test::label("fork")) {
  BOOST_CHECK(meet(3, 6));
  BOOST_CHECK_EQUAL(in_child([] { return meet(3, 6) && sum_of_chunks(1000) == 499500; }), 0);
  BOOST_CHECK(meet(3, 6));
}

BOOST_AUTO_TEST_CASE(a_child_forked_during_another_thread_s_loop_works, *boost::unit_test::label("fork")) {
  std::atomic<bool> begun{false}, over{false};
  std::thread busy([&] {
    const ThreadScope scope(3);
    while (!over) begun = sum_of_chunks(10000) > 0;
  });
  BOOST_REQUIRE(comes([&] { return begun.load(); }));
  for (int round = 0; round < 10; ++round) BOOST_CHECK_EQUAL(in_child([] { return meet(2, 4); }), 0);
  over = true;
  busy.join();
}
#endif

BOOST_AUTO_TEST_CASE(libtorch_s_own_number_of_threads_comes_back) {
  const int before = library_threads();
  {
    const ThreadScope outer(3), inner(2);
    BOOST_CHECK_EQUAL(thread_count(), 2);
    BOOST_CHECK_EQUAL(library_threads(), 1);
    std::atomic<bool> serial{true};
    parallel_jobs(64, [&](Index) {
      if (library_threads() != 1) serial = false;
    });
    BOOST_CHECK(serial);
  }
  BOOST_CHECK_EQUAL(library_threads(), before);
}

/// At least once in so many triangles, in each of the three passes over them.
BOOST_AUTO_TEST_CASE(triangles_that_are_turned_outwards_hear_a_cancel) {
  constexpr int most_at_once = 1 << 14;
  const TriangleMesh mesh = shapes::torus(512, 128);
  int checks = 0;
  const Progress::Interruption counted = [&] {
    ++checks;
    return false;
  };
  Task task;
  const Progress progress(&task, 0.0, 1.0, &counted);
  const CancelScope scope(progress);
  const Triangles facing = outward_triangles(mesh);
  BOOST_CHECK_GE(checks, 3 * facing.rows() / most_at_once);
  task.cancel();
  BOOST_CHECK_THROW(outward_triangles(mesh), Cancelled);
}

// The live solver and its threads, and what several of them read; the thread sanitizer runs these.
BOOST_AUTO_TEST_SUITE(live_threads)

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

BOOST_AUTO_TEST_SUITE_END()
