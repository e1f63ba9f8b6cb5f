// SPDX-License-Identifier: GPL-3.0-or-later
// The other calls of docs/cpp.md, on a mesh: calls IN.obj
#include <arapfields/arapfields.h>

#include <iostream>
#include <thread>

#include "obj.h"

using namespace arapfields;

// [implicit]
/// Any function of points, batched: negative inside, in the cube [-1,1]³ of its frame.
class Ball final : public ImplicitFunction {
 public:
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override {
    values = points.rowwise().norm().array() - 0.5f;
  }
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override {
    evaluate(points, values);
    gradients = points.rowwise().normalized();
  }
  std::optional<double> gradient_bound() const override { return 1.0; }  // where it is known
};
// [implicit]

// [energy]
/// Holds the surface back: half the mean squared distance of its samples from their rest positions.
class Hold final : public ExternalEnergy {
 public:
  double evaluate(PointsIn points, const JetView<const double>& jets,
                  const JetView<double>& cotangents) override {
    const Points off = Eigen::Map<const Points>(jets.data, jets.count, 3) - points;
    const double weight = 1.0 / static_cast<double>(jets.count);
    Eigen::Map<Points>(cotangents.data, jets.count, 3) += weight * off;
    return 0.5 * weight * off.squaredNorm();
  }
};
// [energy]

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const TriangleMesh mesh = read_obj(argv[1]);
  // [fit]
  FitOptions options;
  options.training.iterations = 40;
  const FitResult fit = fit_sdf(mesh.vertices, mesh.triangles, options);
  const TriangleMesh surface = extract_surface(*fit.sdf, 48);
  const SurfaceSamples samples = sample_surface(fit.sdf, {.count = 2000, .seed = 1});
  // [fit]
  // [exact]
  const auto exact = std::make_shared<MeshSdf>(mesh.vertices, mesh.triangles);
  const TriangleMesh remeshed = extract_surface(*exact, 48);
  const SurfaceSamples on_triangles = sample_surface(exact, {.count = 2000, .seed = 1});
  // [exact]
  // [task]
  Task task;
  std::thread caller([&] {
    try {
      stylize(samples, preferred_normals("cube"), StylizeOptions(), Progress(&task));
    } catch (const Cancelled&) {
      std::cout << "cancelled at " << task.progress() << ": " << task.message() << "\n";
    }
  });
  task.cancel();  // from any thread
  caller.join();
  // [task]
  // [live]
  Handle end;
  end.kind = Handle::Kind::point;
  end.rest_point = end.target_point = mesh.vertices.row(0);
  RadialSolver live(samples, {end}, LiveOptions());
  end.target_point.z() += 0.1;
  live.set_targets({end});
  const Points moved = live.solve()->at(mesh.vertices);
  // [live]
  // [session]
  live.set_weights(Vector::Constant(samples.size(), 10.0));
  live.set_symmetry(SymmetryPlane::x);
  end.reach = 0.3;
  live.set_handles({end});
  const Points posed = apply_field(*live.solve(), mesh.vertices, 0.5);
  const SurfaceSamples two = sample_meshes({mesh, surface}, 2000, 1);
  // [session]
  // [along]
  const Points hat = mesh.vertices.array() + 0.2;
  const Attachment attached(samples, hat);  // once; positions() each frame
  const Points hat_moved = attached.positions(*live.field());
  const Mat4 button_motion = rigid_motion(hat, hat_moved);
  // [along]
  // [hooks]
  DeformOptions quick;
  quick.field = FieldKind::radial;
  SolveHooks hooks;
  hooks.energies = {std::make_shared<Hold>()};
  hooks.observer = [](const Iteration& iteration) { return iteration.loss > 1e-3; };  // false ends the solve
  const Solution held = deform(samples, {end}, quick, {}, hooks);
  // [hooks]
  const TriangleMesh ball = extract_surface(Ball(), 32);
  std::cout << surface.vertices.rows() << " " << ball.vertices.rows() << " " << moved.rows() << " "
            << held.report.loop.iterations << "\n";
  std::cout << posed.rows() << " " << two.size() << " " << button_motion(3, 3) << "\n";
  std::cout << remeshed.vertices.rows() << " " << on_triangles.size() << "\n";
  return 0;
}
