// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_embedding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/decompositions.h"
#include "core/parallel.h"
#include "fields/interior_embedding_kernel.h"
#include "fields/radial_basis.h"

namespace arapfields {
namespace {

constexpr Index most_nodes = 1500, least_nodes = 100, landmarks = 64;
/// Ratio of straight distances to the lengths of the graph's paths, which zigzag between nodes.
constexpr double detour = 0.94;
/// Factor on the differences between interior and Euclidean distances.
constexpr double emphasis = 2.0;
/// Weight of smoothing against the embedding's values, and the cutoff of a node's neighbours in spacings.
constexpr double smoothing = 10.0, neighbour_spacings = 3.0;
/// Spread of ψ, as a fraction of the shape's size, below which Euclidean distances are used.
constexpr double worthwhile_spread = 0.04;
/// Logarithm of the weight, relative to the nearest node's, below which nodes are skipped.
constexpr double negligible = -36.0;

using Neighbours = std::vector<std::vector<Index>>;

/// Landmark multidimensional scaling: coordinates (n,3) whose squared distances best approximate `excess`
/// (n, landmarks); the first rows are the landmarks.
Points leading_coordinates(const RowMatrix<double>& excess) {
  const Index count = excess.cols();
  const RowMatrix<double> own = 0.5 * (excess.topRows(count) + excess.topRows(count).transpose());
  const Vector mean = own.rowwise().mean();
  RowMatrix<double> products = -0.5 * own;
  products.colwise() += 0.5 * mean;
  products.rowwise() += 0.5 * mean.transpose();
  products.array() -= 0.5 * mean.mean();
  const auto eigen = symmetric_eigen(products);
  Points result = Points::Zero(excess.rows(), 3);
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.values[count - 1 - k];
    if (!(value > 1e-12)) continue;
    Vector direction = eigen.vectors.col(count - 1 - k) / std::sqrt(value);
    result.col(k) = -0.5 * (excess * direction).array() + 0.5 * mean.dot(direction);
  }
  return result;
}

/// (1 + smoothing · graph Laplacian)⁻¹ values, by conjugate gradients.
Points smoothed(const Points& values, const Neighbours& neighbours) {
  const auto apply = [&](const Points& x) {
    Points y = x;
    for (std::size_t i = 0; i < neighbours.size(); ++i)
      for (const Index j : neighbours[i]) y.row(i) += smoothing * (x.row(i) - x.row(j));
    return y;
  };
  Points x = values, residual = values - apply(x), direction = residual;
  double square = residual.squaredNorm();
  const double enough = 1e-16 * values.squaredNorm();
  for (int i = 0; i < 60 && square > enough; ++i) {
    const Points image = apply(direction);
    const double step = square / direction.cwiseProduct(image).sum();
    x += step * direction;
    residual -= step * image;
    const double next = residual.squaredNorm();
    direction = residual + next / square * direction;
    square = next;
  }
  return x;
}

RowMatrix<double> fitted_slopes(const Points& nodes, const Points& values, const Neighbours& neighbours) {
  RowMatrix<double> slopes = RowMatrix<double>::Zero(nodes.rows(), 9);
  for (Index i = 0; i < nodes.rows(); ++i) {
    Mat3 moments = Mat3::Zero(), products = Mat3::Zero();
    for (const Index j : neighbours[i]) {
      const Vec3 arm = (nodes.row(j) - nodes.row(i)).transpose();
      moments += arm * arm.transpose();
      products += (values.row(j) - values.row(i)).transpose() * arm.transpose();
    }
    if (!(moments.trace() > 0.0)) continue;
    moments.diagonal().array() += 1e-2 * moments.trace();
    const Mat3 slope = products * moments.inverse();
    slopes.row(i) = slope.reshaped<Eigen::RowMajor>().transpose();
  }
  return slopes;
}

/// Projects nodes near the plane onto it and inserts the reflection of each other node after it; returns the
/// twin of each node.
std::vector<Index> add_reflections(Points& nodes, Points& normals, int axis, double width) {
  constexpr double node_on_plane = 0.25;
  const Points places = nodes, directions = normals;
  nodes.resize(2 * places.rows(), 3);
  normals.resize(2 * places.rows(), 3);
  std::vector<Index> twins;
  Index count = 0;
  for (Index i = 0; i < places.rows(); ++i) {
    Eigen::RowVector3d flat = directions.row(i);
    flat[axis] = 0.0;
    const bool on_plane = places(i, axis) < node_on_plane * width && flat.norm() > 0.5;
    for (int k = 0; k < (on_plane ? 1 : 2); ++k) {
      nodes.row(count + k) = places.row(i);
      normals.row(count + k) = on_plane ? Eigen::RowVector3d(flat.normalized()) : directions.row(i);
      nodes(count + k, axis) *= on_plane ? 0.0 : (k == 0 ? 1.0 : -1.0);
      if (!on_plane && k == 1) normals(count + k, axis) *= -1.0;
      twins.push_back(on_plane ? count : count + 1 - k);
    }
    count += on_plane ? 1 : 2;
  }
  nodes.conservativeResize(count, 3);
  normals.conservativeResize(count, 3);
  return twins;
}

/// Makes each coordinate of ψ, which is even or odd across the plane up to rounding, exactly so.
void symmetrise(InteriorEmbedding& embedding, const std::vector<Index>& twins, int axis) {
  const Points values = embedding.values;
  const RowMatrix<double> slopes = embedding.slopes;
  for (int k = 0; k < 3; ++k) {
    double likeness = 0.0;
    for (std::size_t i = 0; i < twins.size(); ++i)
      likeness += values(static_cast<Index>(i), k) * values(twins[i], k);
    const double sign = likeness < 0.0 ? -1.0 : 1.0;
    for (std::size_t i = 0; i < twins.size(); ++i) {
      const auto row = static_cast<Index>(i);
      embedding.values(row, k) = 0.5 * (values(row, k) + sign * values(twins[i], k));
      for (int j = 0; j < 3; ++j)
        embedding.slopes(row, 3 * k + j) =
            0.5 * (slopes(row, 3 * k + j) + (j == axis ? -sign : sign) * slopes(twins[i], 3 * k + j));
    }
  }
}

}  // namespace

void InteriorEmbedding::evaluate(PointsIn points, JetView<double> out) const {
  constexpr Index block = embedding_block;
  const Index count = points.rows(), n = nodes.rows();
  RowMatrix<double> rows(n, embedding_row);
  rows << nodes, values, slopes;
  const double scale = 1.0 / (width * width);
  const int columns_count = columns(out.order);
  parallel_for(0, (count + block - 1) / block, 4, [&](Index first, Index last) {
    std::array<double, 3 * block> packed;
    std::array<double, 30 * block> jets;
    std::vector<std::int32_t> near(n);
    std::vector<double> distance(n);
    for (Index b = first; b < last; ++b) {
      const Index valid = std::min(block, count - b * block);
      const auto part = points.middleRows(b * block, valid);
      const Eigen::RowVector3d center = 0.5 * (part.colwise().minCoeff() + part.colwise().maxCoeff());
      const double radius = std::sqrt((part.rowwise() - center).rowwise().squaredNorm().maxCoeff());
      for (Index i = 0; i < block; ++i)
        for (int k = 0; k < 3; ++k) packed[k * block + i] = part(std::min(i, valid - 1), k);
      double nearest = 1e300;
      for (Index j = 0; j < n; ++j) {
        const double a = nodes(j, 0) - center[0], c = nodes(j, 1) - center[1], d = nodes(j, 2) - center[2];
        distance[j] = std::sqrt(a * a + c * c + d * d);
        nearest = std::min(nearest, distance[j]);
      }
      const double farthest_nearest = nearest + radius;
      const double cutoff =
          std::sqrt(farthest_nearest * farthest_nearest - negligible * width * width) + radius;
      Index near_count = 0;
      for (Index j = 0; j < n; ++j)
        if (distance[j] <= cutoff) near[near_count++] = static_cast<std::int32_t>(j);
      const EmbeddingBlock embedding_block_data{packed.data(), rows.data(), near.data(), near_count, scale};
      ARAPFIELDS_DISPATCH(embedding_jets(embedding_block_data, columns_count, jets.data()));
      for (int c = 0; c < columns_count; ++c)
        for (Index p = 0; p < valid; ++p)
          for (int k = 0; k < 3; ++k) out.at(c, b * block + p)[k] = jets[(c * 3 + k) * block + p];
    }
  });
}

std::shared_ptr<const InteriorEmbedding> interior_embedding(PointsIn samples, PointsIn normals, int axis,
                                                            const MayJoin& may_join) {
  if (samples.rows() < least_nodes || normals.rows() != samples.rows()) return nullptr;
  const Index most = axis < 0 ? most_nodes : most_nodes / 2;
  const FarthestPoints chosen = farthest_points(samples, std::min<Index>(most, samples.rows()));
  if (static_cast<Index>(chosen.indices.size()) < least_nodes || !(chosen.fill_distance > 0.0))
    return nullptr;
  InteriorEmbedding embedding;
  embedding.width = chosen.fill_distance;
  embedding.nodes = samples(chosen.indices, Eigen::all);
  Points node_normals = normals(chosen.indices, Eigen::all);
  std::vector<Index> twins;
  if (axis >= 0) twins = add_reflections(embedding.nodes, node_normals, axis, embedding.width);
  const Index n = embedding.nodes.rows();
  // Landmarks are the first nodes, in complete mirrored pairs.
  const Index count = landmarks + (axis >= 0 && twins[landmarks - 1] == landmarks ? 1 : 0);
  const MayJoin rows_may_join = [&](Index i, Index j) {
    return may_join(chosen.indices[i], chosen.indices[j]);
  };
  const InteriorGraph graph(embedding.nodes, node_normals, embedding.width,
                            may_join ? rows_may_join : MayJoin());
  RowMatrix<double> excess = (detour * graph.distances(count)).array().square();
  for (Index i = 0; i < n; ++i)
    for (Index l = 0; l < count; ++l)
      excess(i, l) =
          std::max(0.0, excess(i, l) - (embedding.nodes.row(i) - embedding.nodes.row(l)).squaredNorm());
  embedding.values = std::sqrt(emphasis) * leading_coordinates(excess);
  Neighbours neighbours(n);
  const float cutoff = static_cast<float>(neighbour_spacings * embedding.width);
  for (Index i = 0; i < n; ++i)
    for (const InteriorGraph::Edge& edge : graph.edges(i))
      if (edge.length < cutoff) neighbours[i].push_back(edge.to);
  embedding.values = smoothed(embedding.values, neighbours);
  const double size =
      (embedding.nodes.colwise().maxCoeff() - embedding.nodes.colwise().minCoeff()).maxCoeff();
  const Eigen::RowVector3d middle = embedding.values.colwise().mean();
  const double spread =
      (embedding.values.rowwise() - middle).colwise().squaredNorm().maxCoeff() / static_cast<double>(n);
  if (spread < worthwhile_spread * worthwhile_spread * size * size) return nullptr;
  embedding.slopes = fitted_slopes(embedding.nodes, embedding.values, neighbours);
  if (axis >= 0) symmetrise(embedding, twins, axis);
  return std::make_shared<const InteriorEmbedding>(std::move(embedding));
}

}  // namespace arapfields
