// SPDX-License-Identifier: GPL-3.0-or-later
// Random scenes in contact: deform, drags, styles on a ground, secondary motion. Nothing may be read or
// written beside an array (the sanitizers tell), every call ends with a result or an error of ours, and all
// numbers are finite. ARAPFIELDS_CONTACT_SCENES="first count" runs other scenes than the few of the tests.
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "distance/mesh_sdf.h"
#include "energies/styles.h"
#include "implicit_shapes.h"
#include "mesh/sample_mesh.h"
#include "shapes.h"
#include "solve/deform.h"
#include "solve/radial/contact_terms.h"
#include "solve/radial/radial_solver.h"
#include "solve/stylize.h"

#if defined(__SANITIZE_ADDRESS__) && (defined(NDEBUG) || defined(EIGEN_NO_DEBUG))
#error "Sanitized builds have the assertions of Eigen on"
#endif

using namespace arapfields;

namespace {

/// The scenes of the tests; the Makefile's word runs many more.
constexpr int few_scenes = 24;

TriangleMesh sheet(double size, double height) {
  TriangleMesh mesh{Points(4, 3), Triangles(2, 3)};
  mesh.vertices << -size, -size, height, size, -size, height, size, size, height, -size, size, height;
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

TriangleMesh moved(TriangleMesh mesh, const Vec3& by) {
  mesh.vertices.rowwise() += by.transpose();
  return mesh;
}

/// What a function of someone else's may throw, at one of its calls.
class Failing final : public shapes::Analytic {
 public:
  Failing(Formula formula, int left) : Analytic(std::move(formula)), left_(left) {}
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override {
    if (--left_ == 0) throw std::runtime_error("the function fails");
    Analytic::evaluate(points, values);
  }
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override {
    if (--left_ == 0) throw std::runtime_error("the function fails");
    Analytic::evaluate(points, values, gradients);
  }

 private:
  mutable int left_;
};

class Scene {
 public:
  explicit Scene(std::uint64_t seed) : random_(seed, 75) {}
  void run();

 private:
  bool chance(double share) { return random_.uniform() < share; }
  Vec3 within(double size) {
    return size * Vec3(random_.uniform(-1, 1), random_.uniform(-1, 1), random_.uniform(-1, 1));
  }
  Mat4 motion(double shift, double turn) {
    Mat4 result = Mat4::Identity();
    result.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(random_.uniform(-turn, turn), random_.direction()).toRotationMatrix();
    result.topRightCorner<3, 1>() = within(shift);
    return result;
  }
  SurfaceSamples surface();
  std::vector<Handle> handles(const SurfaceSamples& samples);
  void move(std::vector<Handle>& handles, double size);
  Obstacle obstacle();
  std::optional<Contact> contact();
  void replace(std::optional<Contact>& contact);
  LiveOptions live_options();
  /// Calls what may throw an error of ours, a failing function's, or Cancelled at a random check.
  void attempt(const std::function<void(const Progress&)>& call);
  void deforms();
  void stylizes();
  void drags();
  static void check(const DeformationField& field, const SurfaceSamples& samples,
                    const ContactReport& report);

  Random random_;
};

SurfaceSamples Scene::surface() {
  const Index count = 150 + random_.below(chance(0.2) ? 1500 : 400);
  const auto seed = random_.bits() % 1000;
  SurfaceSamples samples;
  if (chance(0.6)) {
    const TriangleMesh one = shapes::bar(2.0, 0.2, 24);
    samples = sample_mesh(one.vertices, one.triangles, count, seed);
  } else if (chance(0.4)) {
    const TriangleMesh one = shapes::torus(24, 12, 0.7, 0.25);
    samples = sample_mesh(one.vertices, one.triangles, count, seed);
  } else if (chance(0.4)) {
    const TriangleMesh one = shapes::box_mesh({1.0, 0.4, 0.03 + random_.uniform(0.0, 0.2)}, Vec3::Zero());
    samples = sample_mesh(one.vertices, one.triangles, count, seed);
  } else {
    const double apart = random_.uniform(0.2, 0.6);
    samples = sample_meshes({shapes::bar(2.0, 0.2, 24), moved(shapes::bar(1.6, 0.15, 20), {0.0, 0.0, apart})},
                            count, seed);
  }
  if (chance(0.2)) samples.mesh = nullptr, samples.redraw = nullptr;
  if (chance(0.05)) samples.normals.resize(0, 3);
  return samples;
}

std::vector<Handle> Scene::handles(const SurfaceSamples& samples) {
  std::vector<Handle> result;
  const auto boxed = [&](double x, double width) {
    Handle handle;
    handle.rest.diagonal() << width, 1.0, 1.0, 1.0;
    handle.rest(0, 3) = x;
    handle.target = handle.rest;
    handle.allow_scale = chance(0.1);
    return handle;
  };
  const Index more = random_.below(3);
  result.push_back(boxed(-0.9, random_.uniform(0.15, 0.4)));
  if (chance(0.8)) result.push_back(boxed(0.9, random_.uniform(0.15, 0.4)));
  for (Index k = 0; k < more; ++k) {
    Handle handle;
    const Index row = random_.below(samples.size());
    if (chance(0.7)) {
      handle.kind = Handle::Kind::point;
      handle.rest_point = samples.frame.to_mesh(samples.points.middleRows(row, 1)).row(0).transpose();
      handle.target_point = handle.rest_point;
    } else {
      handle.kind = Handle::Kind::region;
      for (Index i = 0; i < 12; ++i) handle.samples.push_back((row + i) % samples.size());
    }
    if (chance(0.2)) handle.weight = random_.uniform(0.1, 5.0);
    if (chance(0.1)) handle.reach = random_.uniform(0.1, 1.0);
    result.push_back(handle);
  }
  return result;
}

/// Moves all handles but the first one by a random motion.
void Scene::move(std::vector<Handle>& handles, double size) {
  for (std::size_t k = 1; k < handles.size(); ++k) {
    handles[k].target = motion(size, size) * handles[k].rest;
    handles[k].target.topRightCorner<3, 1>() -= Vec3(0, 0, random_.uniform(0.0, size));
    handles[k].target_point = handles[k].rest_point + within(size);
    if (handles[k].allow_scale) handles[k].target.col(1) *= random_.uniform(0.7, 1.4);
  }
}

Obstacle Scene::obstacle() {
  Obstacle result;
  const Vec3 place(random_.uniform(-0.5, 0.8), random_.uniform(-0.2, 0.2), random_.uniform(-0.8, 0.1));
  const Vec3 half(random_.uniform(0.05, 0.4), random_.uniform(0.05, 0.5), random_.uniform(0.02, 0.4));
  const auto of = [](const TriangleMesh& mesh) {
    return std::make_shared<MeshSdf>(mesh.vertices, mesh.triangles);
  };
  if (chance(0.6)) {
    result.function = of(shapes::box_mesh(half, place));
  } else if (chance(0.4)) {
    result.function = of(sheet(random_.uniform(0.5, 2.0), place[2]));
  } else if (chance(0.5)) {
    const auto ball = std::make_shared<shapes::Analytic>(shapes::sphere(random_.uniform(0.2, 0.7)));
    ball->place = {place, random_.uniform(0.5, 1.5)};
    if (chance(0.5)) ball->bound = 1.0;
    result.function = ball;
  } else {
    result.function =
        std::make_shared<Failing>([=](const Vec3& x) { return shapes::box_distance(x - place, half); },
                                  static_cast<int>(1 + random_.below(60)));
  }
  result.margin = chance(0.5) ? 0.0 : random_.uniform(0.0, 0.06);
  if (chance(0.3)) result.placement = motion(0.3, 1.0);
  if (chance(0.1)) result.placement.topLeftCorner<3, 3>() *= random_.uniform(0.5, 2.0);
  return result;
}

std::optional<Contact> Scene::contact() {
  if (chance(0.05)) return std::nullopt;
  Contact result;
  for (Index k = random_.below(3); k >= 0; --k) result.obstacles.push_back(obstacle());
  if (chance(0.3)) result.obstacles.clear();
  if (chance(0.6)) result.ground = random_.uniform(-0.8, -0.1);
  if (chance(0.2)) result.up = random_.direction();
  result.itself = chance(0.5);
  result.friction = chance(0.5) ? 0.5 : random_.uniform(0.0, 2.0);
  return result;
}

/// Another contact in a drag: the same obstacles elsewhere, some new ones, or quite another one.
void Scene::replace(std::optional<Contact>& given) {
  if (!given || chance(0.2)) {
    given = contact();
    return;
  }
  for (Obstacle& each : given->obstacles) {
    if (chance(0.6)) each.placement = motion(chance(0.2) ? 1.0 : 0.1, 0.2) * each.placement;
    if (chance(0.1)) each = obstacle();
  }
  if (given->ground && chance(0.3)) *given->ground += random_.uniform(-0.1, 0.1);
}

LiveOptions Scene::live_options() {
  LiveOptions options;
  options.samples = 300;
  options.coarse_centers = chance(0.2) ? 0 : 12;
  options.fine_centers = static_cast<int>(30 + random_.below(70));
  options.iterations = static_cast<int>(1 + random_.below(12));
  options.interior = chance(0.8);
  options.threads = 1;
  options.seed = static_cast<std::int64_t>(random_.below(100));
  if (chance(0.15)) options.symmetry = chance(0.5) ? SymmetryPlane::y : SymmetryPlane::x;
  return options;
}

void Scene::attempt(const std::function<void(const Progress&)>& call) {
  Task task;
  const bool cancels = chance(0.05);
  Index left = cancels ? 1 + random_.below(200) : -1;
  const Progress::Interruption interruption = [&] { return left > 0 && --left == 0; };
  try {
    call(Progress(&task, 0.0, 1.0, &interruption));
  } catch (const InvalidInput& error) {
    BOOST_TEST_MESSAGE("refused: " << error.what());
  } catch (const Cancelled&) {
    BOOST_TEST(cancels);
  } catch (const Diverged& error) {
    BOOST_TEST(false, error.what());
  } catch (const std::runtime_error& error) {
    BOOST_TEST(std::string(error.what()) == "the function fails");
  }
}

void Scene::check(const DeformationField& field, const SurfaceSamples& samples, const ContactReport& report) {
  BOOST_TEST(field.at(samples.frame.to_mesh(samples.points)).allFinite());
  BOOST_TEST((std::isfinite(report.deepest) && report.deepest >= 0.0));
  BOOST_TEST((report.touching >= 0.0 && std::isfinite(report.touching)));
  for (const HeldBack& held : report.held) BOOST_TEST((std::isfinite(held.distance) && !held.by.empty()));
}

void Scene::deforms() {
  const SurfaceSamples samples = surface();
  std::vector<Handle> held = handles(samples);
  move(held, random_.uniform(0.1, 1.5));
  DeformOptions options;
  options.field = FieldKind::radial;
  options.training.iterations = static_cast<int>(1 + random_.below(40));
  options.training.seed = static_cast<std::int64_t>(random_.below(100));
  options.centers = static_cast<int>(40 + random_.below(100));
  options.machine.threads = 1;
  if (chance(0.15)) options.symmetry = SymmetryPlane::y;
  if (chance(0.1)) options.exact_handles = true;
  SolveHooks hooks;
  hooks.contact = contact();
  attempt([&](const Progress& progress) {
    const Solution found = deform(samples, held, options, progress, hooks);
    check(*found.field, samples, found.report.contact);
  });
}

void Scene::stylizes() {
  SurfaceSamples samples = surface();
  if (samples.size() > 500) return;  // a center a sample: the sanitizers would take minutes
  StylizeOptions options;
  options.field = FieldKind::radial;
  options.strength = random_.uniform(0.2, 1.0);
  options.training.iterations = static_cast<int>(1 + random_.below(15));
  options.machine.threads = 1;
  const std::vector<std::string> names = style_names();
  const Style style(preferred_normals(names[static_cast<std::size_t>(random_.below(std::ssize(names)))]));
  std::vector<Handle> held;
  if (chance(0.3)) held = handles(samples), move(held, 0.5);
  SolveHooks hooks;
  hooks.contact = contact();
  if (hooks.contact && chance(0.8)) hooks.contact->ground = random_.uniform(-0.5, -0.1);
  attempt([&](const Progress& progress) {
    const Solution found = stylize(samples, style, options, progress, {}, held, Vec3::UnitZ(), hooks);
    check(*found.field, samples, found.report.contact);
  });
}

void Scene::drags() {
  const SurfaceSamples samples = surface();
  std::vector<Handle> held = handles(samples);
  std::optional<RadialSolver> solver;
  attempt([&](const Progress& progress) { solver.emplace(samples, held, live_options(), progress); });
  if (!solver) return;
  std::optional<Contact> now = contact();
  attempt([&](const Progress& progress) { solver->set_contact(now, chance(0.2), progress); });
  if (chance(0.5)) {
    SecondaryMotion motion;
    motion.options.gravity = chance(0.5) ? 0.0 : random_.uniform(0.0, 10.0);
    if (chance(0.4)) motion.ground = random_.uniform(-1.0, -0.2);
    attempt([&](const Progress& progress) { solver->set_secondary_motion(motion, progress); });
  }
  std::optional<MotionState> kept;
  const Index frames = 3 + random_.below(8);
  for (Index frame = 0; frame < frames; ++frame) {
    move(held, chance(0.2) ? 1.2 : 0.25);
    if (chance(0.4)) {
      replace(now);
      attempt([&](const Progress& progress) { solver->set_contact(now, chance(0.2), progress); });
    }
    attempt([&](const Progress&) {
      if (chance(0.1)) solver->reset();
      if (chance(0.05)) held = handles(samples), solver->set_handles(held);
      if (chance(0.1)) solver->set_style(preferred_normals("cube"), random_.uniform(0.0, 1.0), 0.0);
      if (chance(0.05)) solver->set_symmetry(chance(0.5) ? SymmetryPlane::none : SymmetryPlane::z);
      if (chance(0.05)) solver->set_secondary_motion(std::nullopt);
      if (chance(0.2)) kept = solver->motion_state();
      if (kept && chance(0.2)) solver->set_motion_state(*kept);
    });
    attempt([&](const Progress& progress) {
      if (chance(0.5)) {
        const Mat4 coordinates = chance(0.2) ? motion(0.2, 0.3) : Mat4(Mat4::Identity());
        solver->step(held, random_.uniform(0.005, 0.05), progress, coordinates);
      } else {
        solver->set_targets(held);
        solver->solve(0, 0.0, progress);
      }
      check(*solver->field(), samples, solver->report().contact);
    });
  }
}

void Scene::run() {
  const ThreadScope threads(1);
  const double which = random_.uniform();
  if (which < 0.45) return deforms();
  if (which < 0.5) return stylizes();
  drags();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(contact_scenes)

BOOST_AUTO_TEST_CASE(random_scenes_end_with_finite_shapes) {
  std::uint64_t first = 0, count = few_scenes;
  const char* const wanted = std::getenv("ARAPFIELDS_CONTACT_SCENES");
  if (wanted != nullptr) std::istringstream(wanted) >> first >> count;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    if (wanted != nullptr) std::fprintf(stderr, "\rscene %llu ", static_cast<unsigned long long>(seed));
    BOOST_TEST_CONTEXT("scene " << seed) Scene(seed).run();
  }
}

BOOST_AUTO_TEST_SUITE_END()
