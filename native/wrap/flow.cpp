// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/flow.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "core/jets.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "energies/rotation.h"
#include "fields/radial_evaluator.h"
#include "mesh/sample_mesh.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

constexpr Index block_size = 16;

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// The contribution of a block of 16 neighbouring points to the normal equations, for the basis functions
/// whose support it meets.
template <typename Scalar>
struct PointBlock {
  using Matrix = RowMatrix<Scalar>;

  std::vector<Index> functions;  // ascending
  Matrix values;                 // (functions, points)
  Matrix gradients;              // (functions, 6 points): weighted, along the columns of J and along the axes
  Matrix right_hand_side;        // (functions, 3)
  Eigen::Matrix<Scalar, block_size, 6> forms;

  PointBlock(const RadialBlock<double>& block, Index first, Index centers, const MotionStiffness& stiffness,
             const CorrespondenceTerms& correspondences) {
    const Index count = block.active_count, all = count + 4;
    functions.assign(block.active, block.active + count);
    for (Index k = 0; k < 4; ++k) functions.push_back(centers + k);
    values.setZero(all, block_size);
    gradients.setZero(all, 6 * block_size);
    right_hand_side.setZero(all, 3);
    forms.setZero();

    std::vector<double> rows(count * 4 * block_size);
    ARAPFIELDS_DISPATCH(radial_rows(block, 4, rows.data()));
    const auto row = [&](Index a, int c, Index p) {
      return static_cast<Scalar>(rows[(a * 4 + c) * block_size + p]);
    };
    Matrix slopes = Matrix::Zero(all, 3);  // derivatives of the basis functions at one point
    slopes.bottomRows(3).setIdentity();
    const Index valid = std::min<Index>(block_size, stiffness.points.rows() - first);
    for (Index p = 0; p < valid; ++p) {
      const Index i = first + p;
      for (Index a = 0; a < count; ++a) {
        values(a, p) = row(a, 0, p);
        for (int k = 0; k < 3; ++k) slopes(a, k) = row(a, 1 + k, p);
      }
      values(count, p) = 1;
      values.col(p).template tail<3>() = stiffness.points.row(i).transpose().template cast<Scalar>();
      forms.row(p) = correspondences.forms.row(i).template cast<Scalar>();
      right_hand_side.noalias() +=
          values.col(p) * correspondences.right_hand_sides.row(i).template cast<Scalar>();
      const Mat3 jacobian = Eigen::Map<const RowMat3>(&stiffness.jacobians(i, 0));
      add_stiffness(p, closest_rotation(jacobian) - jacobian,
                    stiffness.at_rest ? slopes : Matrix(slopes * jacobian.template cast<Scalar>()),
                    static_cast<Scalar>(stiffness.rigidity[i]), static_cast<Scalar>(stiffness.viscosity[i]),
                    slopes);
    }
  }

 private:
  void add_stiffness(Index p, const Mat3& missing, const Matrix& along, Scalar rigidity, Scalar viscosity,
                     const Matrix& slopes) {
    right_hand_side.noalias() += rigidity * along * missing.template cast<Scalar>().transpose();
    for (int k = 0; k < 3; ++k) {
      gradients.col(k * block_size + p) = std::sqrt(rigidity) * along.col(k);
      gradients.col((3 + k) * block_size + p) = std::sqrt(viscosity) * slopes.col(k);
    }
  }
};

template <typename Scalar>
std::vector<PointBlock<Scalar>> point_blocks(const RadialBasis& basis, const MotionStiffness& stiffness,
                                             const CorrespondenceTerms& correspondences) {
  const RadialEvaluator<double> field(basis, stiffness.points, JetOrder::first);
  std::vector<std::optional<PointBlock<Scalar>>> blocks(field.blocks());
  parallel_for(0, field.blocks(), 4, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b)
      blocks[b].emplace(field.block(b), b * block_size, basis.center_count(), stiffness, correspondences);
  });
  std::vector<PointBlock<Scalar>> result;
  for (auto& block : blocks) result.push_back(std::move(*block));
  return result;
}

/// The lower triangle (size, size) of the matrix that all coordinates share (entry −1: stiffness), or that
/// couples two of them (0 to 5: xx, yy, zz, xy, xz, yz: correspondences).
template <typename Scalar>
RowMatrix<double> matrix_of(const std::vector<PointBlock<Scalar>>& blocks, Index size, int entry,
                            const Progress& progress) {
  RowMatrix<double> sum = RowMatrix<double>::Zero(size, size);
  RowMatrix<Scalar> product, scaled;
  for (const PointBlock<Scalar>& block : blocks) {
    if (progress.cancelled()) break;
    const auto count = static_cast<Index>(block.functions.size());
    product.resize(count, count);
    if (entry < 0) {
      lower_gram<Scalar>(Transpose::no, block.gradients, 0, product);
    } else {
      scaled = block.values * block.forms.col(entry).asDiagonal();
      gemm<Scalar>(Transpose::no, Transpose::yes, 1, scaled, block.values, 0, product);
    }
    for (Index i = 0; i < count; ++i) {
      double* row = &sum(block.functions[i], 0);
      for (Index j = 0; j <= i; ++j) row[block.functions[j]] += static_cast<double>(product(i, j));
    }
  }
  return sum;
}

template <typename Scalar>
RowMatrix<double> right_hand_side_of(const std::vector<PointBlock<Scalar>>& blocks, Index size) {
  RowMatrix<double> sum = RowMatrix<double>::Zero(size, 3);
  for (const PointBlock<Scalar>& block : blocks)
    for (std::size_t i = 0; i < block.functions.size(); ++i)
      sum.row(block.functions[i]) += block.right_hand_side.row(i).template cast<double>();
  return sum;
}

/// Adds a symmetric matrix, given by its lower triangle, to a block of a larger one.
void add_block(const RowMatrix<double>& lower, int row, int column, RowMatrix<double>& matrix) {
  const Index size = lower.rows();
  parallel_for(0, size, 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < (row == column ? i + 1 : size); ++j)
        matrix(row * size + i, column * size + j) += j <= i ? lower(i, j) : lower(j, i);
  });
}

RowMatrix<double> regularized_cholesky(RowMatrix<double>& matrix) {
  double added = regularization * matrix.diagonal().mean();
  for (int attempt = 0;; ++attempt) {
    matrix.diagonal().array() += added;
    try {
      return cholesky<double>(matrix);
    } catch (const InvalidInput&) {
      if (attempt == regularization_retries) throw;
    }
    added *= regularization_growth;
  }
}

/// solve_velocity() with products of this precision.
template <typename Scalar>
RowMatrix<double> solution_of(const RadialBasis& basis, const MotionStiffness& stiffness,
                              const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                              const Progress& progress) {
  constexpr int entry_of[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
  const Index size = basis.size();

  // Terms of the surface's points.
  const std::vector<PointBlock<Scalar>> blocks = point_blocks<Scalar>(basis, stiffness, correspondences);
  progress.check();
  std::array<RowMatrix<double>, 7> matrices;  // the first is shared by the coordinates
  parallel_jobs(
      7, [&](Index job) { matrices[job] = matrix_of(blocks, size, static_cast<int>(job) - 1, progress); });
  progress.check();
  RowMatrix<double>& shared = matrices[0];
  RowMatrix<double> columns = right_hand_side_of(blocks, size);

  // Ridge and landmarks, which act on each coordinate alone.
  shared.diagonal().head(basis.center_count()).array() += stiffness.ridge;
  if (landmarks.points.rows() > 0) {
    const RowMatrix<double> rows = radial_rows(basis, landmarks.points, JetOrder::value);
    const double weight = landmarks.weight / static_cast<double>(rows.rows());
    shared += weight * rows.transpose() * rows;
    columns += weight * rows.transpose() * landmarks.displacements;
  }

  // One system for all coordinates.
  RowMatrix<double> matrix = RowMatrix<double>::Zero(3 * size, 3 * size), right_hand_side(3 * size, 1);
  for (int q = 0; q < 3; ++q) {
    add_block(shared, q, q, matrix);
    for (int r = 0; r <= q; ++r) add_block(matrices[1 + entry_of[q][r]], q, r, matrix);
    right_hand_side.middleRows(q * size, size) = columns.col(q);
  }
  progress.check();
  const RowMatrix<double> solution = cholesky_solve<double>(regularized_cholesky(matrix), right_hand_side);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>>(solution.data(), size, 3);
}

}  // namespace

RowMatrix<double> solve_velocity(const RadialBasis& basis, const MotionStiffness& stiffness,
                                 const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                                 const Progress& progress) {
  // The weights of held points, relative to stiffness, exceed what single precision resolves.
  return stiffness.at_rest ? solution_of<double>(basis, stiffness, correspondences, landmarks, progress)
                           : solution_of<float>(basis, stiffness, correspondences, landmarks, progress);
}

namespace {

using namespace wrap_parameters;
// Tuned on pairs with a known map, such that unlike shapes come as near to their targets as without
// smoothing.

/// Weight in the last stage of tangential distances to the smoothing spline through the surface's current
/// places (SmoothingSpline), relative to correspondences: it removes tangential noise.
constexpr double smooth_weight = 0.6;
/// Places that the spline fits, and its smoothing parameter there.
constexpr Index map_places = 1000;
constexpr double smoothing = 1e-3;
/// Distance from the spline, as a fraction of the diagonal, at which its weight is a quarter: larger ones
/// occur where sheets of the surface separate.
constexpr double smooth_distance = 0.002;

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// t: 0 in the first stage, 1 in the last.
WrapStage stage_at(double t, const WrapOptions& options, const LandmarkPull& pull,
                   const SlidingSchedule& sliding) {
  const auto most_centers = static_cast<double>(options.centers);
  const Schedule closeness{correspondence_weight.first, correspondence_weight.last * options.closeness},
      centers{std::min(first_centers, most_centers), most_centers};
  WrapStage stage;
  stage.correspondences = {.weight = closeness.at(t),
                           .coverage = coverage * options.coverage,
                           .normals = options.normal_weight,
                           .tangential = sliding.tangential.at(t),
                           .curvature = curvature_weight * std::pow(t, 4),
                           .unoriented = unoriented_weight * t * t};
  stage.landmarks = pull.weight * std::pow(pull.growth, t);
  stage.smoothness = t < 1.0 || !sliding.is_smooth ? 0.0 : smooth_weight;
  stage.rigidity = rigidity.at(t);
  stage.viscosity = viscosity * options.bending;
  stage.center_radius = center_radius.at(t);
  stage.centers = static_cast<Index>(std::round(centers.at(t)));
  return stage;
}

/// The squared singular values, ascending.
Vec3 squared_singular_values(const Mat3& matrix) {
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(matrix.transpose() * matrix, Eigen::EigenvaluesOnly);
  return solver.eigenvalues();
}

/// The largest singular value of the velocity's gradient over the points.
double gradient_norm(const RadialBasis& basis, const RowMatrix<double>& velocity, PointsIn points) {
  JetBlock<double> jets(points.rows(), JetOrder::first);
  RadialEvaluator<double>(basis, points, JetOrder::first).evaluate(velocity, jets.view());
  double largest = 0.0;
  for (Index i = 0; i < points.rows(); ++i) {
    const Mat3 gradient = jacobian_at(std::as_const(jets).view(), i);
    largest = std::max(largest, squared_singular_values(gradient)[2]);
  }
  return std::sqrt(largest);
}

}  // namespace

Points moved_normals(const RowMatrix<double>& jacobians, PointsIn normals, Vector& growth) {
  Points result = normals;
  growth.resize(normals.rows());
  for (Index i = 0; i < normals.rows(); ++i) {
    const Mat3 jacobian = Eigen::Map<const RowMat3>(&jacobians(i, 0));
    const Vec3 normal = cofactors(jacobian) * normals.row(i).transpose();
    growth[i] = normal.norm();
    if (growth[i] > 0.0) result.row(i) = normal.transpose() / growth[i];
  }
  return result;
}

/// The samples in one step's equations, with a density between those of the rest area and the current area.
struct WrapFlow::StepSamples {
  SurfacePoints surface;  // area weights: the mean of those at rest and now
  RowMatrix<double> jacobians;
  Points rest;
  Vector rest_area_weights, current_area_weights, weights, bend_weights;
};

WrapFlow::WrapFlow(const SurfaceSamples& samples, const WrapTarget& target, PointsIn landmarks,
                   PointsIn landmark_targets, LandmarkPull pull, std::uint64_t seed, const Progress& progress)
    : target_(target),
      random_(seed),
      landmarks_(landmarks),
      landmark_targets_(landmark_targets),
      pull_(std::move(pull)) {
  const std::vector<Index> rows = stratified(morton_order(samples.points), moved_samples, random_);
  points_ = rows_of(samples.points, rows);
  rest_points_ = points_;
  rest_normals_ = rows_of(samples.normals, rows);
  if (samples.weights.size() > 0) weights_ = entries_of(samples.weights, rows);
  if (samples.bend_weights.size() > 0) bend_weights_ = entries_of(samples.bend_weights, rows);
  if (target_.curvature.values.size() > 0) {
    const SurfaceSamples all =
        sample_mesh(samples.mesh->vertices, samples.mesh->triangles, curvature_samples, seed);
    curvatures_ = curvature_values(samples.frame.to_cube(all.frame.to_mesh(all.points)), all.normals, points_,
                                   rest_normals_, target_.curvature.radius, progress);
  }
  jacobians_.setZero(points_.rows(), 9);
  for (int k = 0; k < 3; ++k) jacobians_.col(4 * k).setOnes();
}

/// Stratified sampling of about `count` points, half by the area at rest and half by the current area.
WrapFlow::StepSamples WrapFlow::draw_samples(Index count) {
  const Index all = points_.rows();
  Vector growth;
  const Points normals = moved_normals(jacobians_, rest_normals_, growth);
  const Vector density = 0.5 * (growth / growth.sum()).array() + 0.5 / static_cast<double>(all);  // sums to 1
  std::vector<Index> rows;
  double passed = random_.uniform() / static_cast<double>(count);
  double sum = 0.0;
  for (Index i = 0; i < all; ++i) {
    sum += density[i];
    if (sum <= passed) continue;
    rows.push_back(i);
    while (passed < sum) passed += 1.0 / static_cast<double>(count);
  }

  StepSamples chosen;
  chosen.surface.points = rows_of(points_, rows);
  chosen.surface.normals = rows_of(normals, rows);
  chosen.rest = rows_of(rest_points_, rows);
  chosen.jacobians = jacobians_(rows, Eigen::all);
  if (curvatures_.size() > 0)
    chosen.surface.curvatures =  // curvature scales with the inverse length
        growth(rows).array().rsqrt().matrix().asDiagonal() * curvatures_(rows, Eigen::all);
  Vector represented = density(rows) * static_cast<double>(count);
  represented = represented.cwiseMin(1.0).cwiseInverse();
  chosen.rest_area_weights = represented / represented.sum();
  chosen.current_area_weights = growth(rows).cwiseProduct(represented);
  chosen.current_area_weights /= chosen.current_area_weights.sum();
  chosen.surface.area_weights = 0.5 * (chosen.rest_area_weights + chosen.current_area_weights);
  if (weights_.size() > 0) chosen.weights = entries_of(weights_, rows);
  if (bend_weights_.size() > 0) chosen.bend_weights = entries_of(bend_weights_, rows);
  return chosen;
}

Points WrapFlow::smooth_places(PointsIn rest, const Progress& progress) {
  if (!spline_) {
    spline_rows_ = farthest_points(rest_points_, map_places).indices;
    const auto count = static_cast<Index>(spline_rows_.size());
    spline_.emplace(rows_of(rest_points_, spline_rows_), Vector::Constant(count, smoothing), progress);
  }
  return spline_->fit(rows_of(points_, spline_rows_)).at(rest);
}

/// Centers at farthest-point samples of both surfaces together.
RadialBasis WrapFlow::basis(const WrapStage& stage, PointsIn points) {
  const Index each = candidates_a_center * stage.centers / 2;
  const std::vector<Index> source_rows = random_subset(points.rows(), each, random_);
  const std::vector<Index> target_rows = random_subset(target_.points.rows(), each, random_);
  Points candidates(static_cast<Index>(source_rows.size() + target_rows.size()), 3);
  candidates << rows_of(points, source_rows), rows_of(target_.points, target_rows);
  RadialBasis basis;
  basis.centers = rows_of(candidates, farthest_points(candidates, stage.centers).indices);
  basis.radii = Vector::Constant(basis.centers.rows(), stage.center_radius * target_.diagonal);
  return basis;
}

void WrapFlow::move(const RadialBasis& basis, RowMatrix<double> velocity, PointsIn points) {
  // Split and shorten the motion until it is invertible.
  Points tested(points.rows() + basis.center_count(), 3);
  tested << points, basis.centers;
  const double largest = gradient_norm(basis, velocity, tested);
  const int repeats = std::clamp(static_cast<int>(std::ceil(largest / largest_gradient)), 1, most_substeps);
  velocity *= std::min(1.0, largest_gradient * repeats / std::max(largest, 1e-12)) / repeats;
  velocity += basis.identity();
  FieldStep step{std::make_shared<RadialField>(basis, std::move(velocity)), repeats};

  // Move samples, their Jacobians and landmarks.
  const Index n = points_.rows(), landmark_count = landmarks_.rows();
  JetBlock<double> jets(n, JetOrder::first);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    RadialEvaluator<double>(basis, points_, JetOrder::first).evaluate(step.map->coefficients(), jets.view());
    for (Index i = 0; i < n; ++i) {
      points_.row(i) = Eigen::Map<const Vec3>(jets.view().at(0, i));
      RowMat3 gradient;
      for (int k = 0; k < 3; ++k)
        gradient.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), i));
      Eigen::Map<RowMat3> jacobian(&jacobians_(i, 0));
      jacobian = (gradient * jacobian).eval();
    }
    if (landmark_count == 0) continue;
    Points moved(landmark_count, 3);
    RadialEvaluator<double>(basis, landmarks_, JetOrder::value)
        .evaluate(step.map->coefficients(), {moved.data(), landmark_count, JetOrder::value});
    landmarks_ = moved;
  }
  steps_.push_back(std::move(step));
}

void WrapFlow::step(const WrapStage& stage, const Progress& progress) {
  const double unit = 1.0 / (target_.diagonal * target_.diagonal);
  const StepSamples samples =
      draw_samples(std::clamp(samples_a_center * stage.centers, least_samples, most_samples));

  // Correspondences.
  CorrespondenceWeights weights = stage.correspondences;
  weights.weight *= unit;
  CorrespondenceTerms correspondences(target_, samples.surface, weights);
  if (stage.smoothness > 0.0)
    correspondences.add_along(samples.surface, smooth_places(samples.rest, progress),
                              stage.smoothness * weights.weight * (1.0 + weights.coverage),
                              smooth_distance * target_.diagonal);
  matched_share_ = correspondences.matched_share;
  progress.report(0.2);

  // Stiffness. On an open target, parts without a counterpart keep the rigidity of the first stage.
  MotionStiffness stiffness{samples.surface.points, samples.jacobians,
                            stage.rigidity * samples.rest_area_weights,
                            stage.viscosity * samples.current_area_weights, ridge * unit};
  if (!target_.closed)
    stiffness.rigidity =
        samples.rest_area_weights.array() *
        (stage.rigidity + (1.0 - stage.rigidity) * (1.0 - correspondences.match_weights.array()));
  if (samples.weights.size() > 0) stiffness.rigidity = stiffness.rigidity.cwiseProduct(samples.weights);
  if (samples.bend_weights.size() > 0)
    stiffness.viscosity = stiffness.viscosity.cwiseProduct(samples.bend_weights);

  // Velocity, and the motion along it.
  const LandmarkTerm landmarks{rows_of(landmarks_, pull_.rows),
                               rows_of(landmark_targets_ - landmarks_, pull_.rows), stage.landmarks * unit};
  const RadialBasis centers = basis(stage, samples.surface.points);
  move(centers, solve_velocity(centers, stiffness, correspondences, landmarks, progress.part(0.2, 0.8)),
       samples.surface.points);
  progress.report(1.0);
}

void WrapFlow::run(const WrapOptions& options, const Progress& progress, const std::function<void()>& after,
                   const SlidingSchedule& sliding) {
  const double all = options.stages * options.iterations;
  for (int done = 0; done < all; ++done) {
    const int stage = done / options.iterations;
    const double t = options.stages > 1 ? static_cast<double>(stage) / (options.stages - 1) : 1.0;
    step(stage_at(t, options, pull_, sliding), progress.part(done / all, (done + 1) / all));
    if (after) after();
  }
}

double WrapFlow::stretch() const {
  const Index all = points_.rows(), count = std::min(all, stretch_samples);
  double sum = 0.0;
  for (Index k = 0; k < count; ++k) {
    const Mat3 jacobian = Eigen::Map<const RowMat3>(&jacobians_(k * all / count, 0));
    sum += (squared_singular_values(jacobian).array().max(0.0).sqrt() - 1.0).square().sum();
  }
  return sum / static_cast<double>(count);
}

}  // namespace arapfields
