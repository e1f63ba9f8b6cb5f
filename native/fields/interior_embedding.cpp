// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_embedding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "fields/interior_embedding_kernel.h"
#include "fields/multidimensional_scaling.h"
#include "fields/radial_basis.h"
#include "mesh/outward_triangles.h"
#include "mesh/pieces.h"
#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

constexpr Index most_nodes = 1500, least_nodes = 100, landmarks = 64;
/// Points of a fine region for each node of its part.
constexpr Index points_a_node = 4;
/// Ratio of straight distances to the lengths of the graph's paths, which zigzag between nodes.
constexpr double detour = 0.94;
/// Factor on the differences between interior and Euclidean distances.
constexpr double emphasis = 2.0;
/// Weight of smoothing against the embedding's values, less where a part's nodes are near enough, and the
/// cutoff of a node's neighbours in spacings.
constexpr double smoothing = 10.0, part_smoothing = 1.0, neighbour_spacings = 3.0;
/// ψ of a part keeps distances of nodes that are near in space before others: up to about so many widths.
/// The leading coordinates of all distances would lay two of a hand's fingers into each other, since more
/// than four ends that are equally far from each other need more than three coordinates.
constexpr double stress_widths = 4.0;
/// Spread of ψ, as a fraction of the shape's size, below which Euclidean distances are used.
constexpr double worthwhile_spread = 0.04;
/// Logarithm of the weight, relative to the nearest node's, below which nodes are skipped.
constexpr double negligible = -36.0;

/// Where parts of the shape nearly touch: a sample this near, in widths, whose normal is opposite (its cosine
/// is below), in front of the node or hardly behind it (as a share of the width). A part's nodes look
/// farther, since there gaps are seldom narrower than its nodes' spacing.
constexpr double facing_widths = 1.0, part_facing_widths = 2.5, facing_cosine = -0.3, facing_behind = 1e-3;
/// Distance, in widths, up to which it matters what a node sees: a point is within one width of its own
/// node, and a weight of e^{−9} is little.
constexpr double sight_widths = 4.0;
/// Distance, in widths, of a hidden node up to which it may be the nearest one to a point of the other side.
constexpr double doubtful_widths = 2.5;
/// A node that is not seen lies around a bend of the surface, and counts as one that is seen, up to the first
/// ratio of interior to straight distances, and beyond a gap from the second one: the nodes' zigzag alone
/// makes paths a quarter longer.
constexpr double bend_ratio = 1.3, gap_ratio = 2.0;
/// The excess at a point is blended from nodes near by, up to this distance from its side's, in widths, with
/// Gaussian weights of this width, so that it changes smoothly from side to side.
constexpr double company_widths = 2.2, blend_widths = 0.8;
/// Longest interior distance that is looked for, in widths: nodes beyond it have no weight.
constexpr double longest_widths = 6.0;
/// Rounds over a mesh's vertices in which the ends of edges come to lie on sides that see each other: two or
/// three are enough.
constexpr int most_rounds = 8;
/// Depth of eyes below the surface, in widths.
constexpr double eye_widths = 0.15;
/// Nodes that are tried, in the order of distance, before a point takes the nearest one with a like normal.
constexpr Index most_tried = 12;
constexpr double like_cosine = 0.3;

using Neighbours = std::vector<std::vector<Index>>;

/// (1 + smoothing · graph Laplacian)⁻¹ values, by conjugate gradients.
Points smoothed(const Points& values, const Neighbours& neighbours, double strength) {
  const auto apply = [&](const Points& x) {
    Points y = x;
    for (std::size_t i = 0; i < neighbours.size(); ++i)
      for (const Index j : neighbours[i]) y.row(i) += strength * (x.row(i) - x.row(j));
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

InsideSight::Eyes eyes_of(PointsIn points, PointsIn normals, double width, const InsideSight& mesh) {
  return mesh.below(points, normals, Vector::Constant(points.rows(), eye_widths * width));
}

}  // namespace

void NodeSight::set_nodes(PointsIn nodes, double width) {
  nearest_node_ = std::make_shared<const SignedDistance>(nearest_samples(nodes));
  doubtful_.assign(static_cast<std::size_t>(nodes.rows()), false);
  const double near = doubtful_widths * width;
  for (Index i = 0; i < nodes.rows(); ++i)
    doubtful_[i] = std::any_of(
        others.begin() + starts[i], others.begin() + starts[i + 1],
        [&](std::int32_t other) { return (nodes.row(i) - nodes.row(other)).squaredNorm() < near * near; });
  const double together = company_widths * width;
  company_.assign(static_cast<std::size_t>(nodes.rows()), {});
  parallel_for(0, nodes.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < nodes.rows(); ++j)
        if ((nodes.row(i) - nodes.row(j)).squaredNorm() < together * together &&
            !hides(static_cast<SurfaceSide>(i), static_cast<SurfaceSide>(j)))
          company_[i].push_back(static_cast<std::int32_t>(j));
  });
}

std::vector<SurfaceSide> NodeSight::nearest_nodes(PointsIn points) const {
  return nearest_node_->closest(points).triangles;
}

void NodeSight::set_places(PointsIn places, std::vector<SurfaceSide> sides) {
  places_ = places;
  sides_ = std::move(sides);
  nearest_place_ =
      places_.rows() > 0 ? std::make_shared<const SignedDistance>(nearest_samples(places_)) : nullptr;
}

std::vector<SurfaceSide> NodeSight::sides_near(PointsIn points) const {
  if (points.rows() == 0) return {};
  const ClosestPoints nearest = nearest_node_->closest(points);
  std::vector<SurfaceSide> result = nearest.triangles;
  std::vector<Index> rows;
  for (Index i = 0; i < points.rows(); ++i)
    if (!(nearest.distances[i] < reach))
      result[i] = -1;
    else if (nearest_place_ && is_doubtful(result[i]))
      rows.push_back(i);
  if (rows.empty()) return result;
  const std::vector<std::int32_t> places = nearest_place_->closest(points(rows, Eigen::all)).triangles;
  for (std::size_t k = 0; k < rows.size(); ++k) result[rows[k]] = sides_[places[k]];
  return result;
}

bool NodeSight::hides(SurfaceSide node, SurfaceSide other) const {
  return std::binary_search(others.begin() + starts[node], others.begin() + starts[node + 1], other);
}

namespace {

/// Weights with which the excess at a place is blended from the company of its side: jets (company, 10) of
/// normalised Gaussians about the nodes.
void blend_weights(const Vec3& place, const Points& nodes, const std::vector<std::int32_t>& company,
                   double width, int columns_count, std::vector<std::array<double, 10>>& weights) {
  const double scale = 1.0 / (blend_widths * blend_widths * width * width);
  weights.assign(company.size(), {});
  double nearest = std::numeric_limits<double>::infinity(), sum = 0.0;
  const auto square = [&](std::size_t m) {
    return (nodes.row(company[m]).transpose() - place).squaredNorm();
  };
  for (std::size_t m = 0; m < company.size(); ++m) nearest = std::min(nearest, square(m));
  for (std::size_t m = 0; m < company.size(); ++m)
    sum += weights[m][0] = std::exp((nearest - square(m)) * scale);
  Vec3 middle = Vec3::Zero();
  for (std::size_t m = 0; m < company.size(); ++m) {
    weights[m][0] /= sum;
    middle += weights[m][0] * nodes.row(company[m]).transpose();
  }
  if (columns_count < 4) return;
  // Of the logarithm of a weight the gradient is a, and the Hessian −Σ s a aᵀ over all, the same for each.
  const auto slope = [&](std::size_t m) -> Vec3 {
    return 2.0 * scale * (nodes.row(company[m]).transpose() - middle);
  };
  Mat3 spread = Mat3::Zero();
  for (std::size_t m = 0; m < company.size(); ++m) spread += weights[m][0] * slope(m) * slope(m).transpose();
  for (std::size_t m = 0; m < company.size(); ++m) {
    const Vec3 a = slope(m);
    const Mat3 bend = weights[m][0] * (a * a.transpose() - spread);
    for (int i = 0; i < 3; ++i) weights[m][static_cast<std::size_t>(first_column(i))] = weights[m][0] * a[i];
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) weights[m][static_cast<std::size_t>(second_column(i, j))] = bend(i, j);
  }
}

}  // namespace

bool InteriorEmbedding::has_sides() const {
  return sight != nullptr || std::ranges::any_of(parts, [](const EmbeddingPart& part) {
           return part.embedding.sight != nullptr;
         });
}

namespace {

/// Replaces the jets of u at a point by those of u + s (v − u), with the jets of v and of s, which is the
/// first component of `shares`, at row p.
void blend_jets(JetView<const double> v, JetView<const double> shares, Index p, JetView<double> u,
                Index row) {
  std::array<double, 10> s{};
  std::array<Vec3, 10> difference;
  for (int c = 0; c < columns(u.order); ++c) {
    s[static_cast<std::size_t>(c)] = shares.at(c, p)[0];
    difference[static_cast<std::size_t>(c)] =
        Eigen::Map<const Vec3>(v.at(c, p)) - Eigen::Map<const Vec3>(u.at(c, row));
  }
  const auto add = [&](int c, const Vec3& more) { Eigen::Map<Vec3>(u.at(c, row)) += more; };
  add(0, s[0] * difference[0]);
  if (columns(u.order) < 4) return;
  const auto d = [&](int c) -> const Vec3& { return difference[static_cast<std::size_t>(c)]; };
  const auto of_share = [&](int c) { return s[static_cast<std::size_t>(c)]; };
  for (int i = 0; i < 3; ++i) {
    const int column = first_column(i);
    add(column, of_share(column) * d(0) + s[0] * d(column));
  }
  if (columns(u.order) < 10) return;
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) {
      const int column = second_column(i, j);
      add(column, of_share(column) * d(0) + of_share(first_column(i)) * d(first_column(j)) +
                      of_share(first_column(j)) * d(first_column(i)) + s[0] * d(column));
    }
}

}  // namespace

void InteriorEmbedding::evaluate(PointsIn points, JetView<double> out,
                                 const std::vector<SurfaceSide>* sides) const {
  if (parts.empty()) return evaluate_own(points, out, sides);
  std::vector<SurfaceSide> own;
  if (sides != nullptr) {
    std::vector<SurfaceSide> of_nodes(static_cast<std::size_t>(nodes.rows()));
    std::iota(of_nodes.begin(), of_nodes.end(), SurfaceSide{0});
    for (const EmbeddingPart& part : parts)
      of_nodes.insert(of_nodes.end(), part.sides.begin(), part.sides.end());
    for (const SurfaceSide side : *sides)
      own.push_back(side < 0 ? side : of_nodes[static_cast<std::size_t>(side)]);
  }
  evaluate_own(points, out, sides != nullptr ? &own : nullptr);
  auto first = static_cast<SurfaceSide>(nodes.rows());
  for (const EmbeddingPart& part : parts) {
    const std::vector<Index> rows = part.ball.rows_inside(points);
    const auto count = static_cast<SurfaceSide>(part.embedding.nodes.rows());
    std::vector<SurfaceSide> of_rows;
    for (std::size_t k = 0; sides != nullptr && k < rows.size(); ++k) {
      const SurfaceSide side = (*sides)[static_cast<std::size_t>(rows[k])] - first;
      of_rows.push_back(side >= 0 && side < count ? side : -1);
    }
    const Points near = points(rows, Eigen::all);
    const std::vector<SurfaceSide>* const part_sides = sides != nullptr ? &of_rows : nullptr;
    JetBlock<double> own_jets(near.rows(), out.order), shares(near.rows(), out.order);
    part.embedding.evaluate_own(near, own_jets.view(), part_sides);
    part.share.evaluate_own(near, shares.view(), part_sides);
    for (Index p = 0; p < near.rows(); ++p)
      blend_jets(own_jets.view(), shares.view(), p, out, rows[static_cast<std::size_t>(p)]);
    first += count;
  }
}

void InteriorEmbedding::evaluate_own(PointsIn points, JetView<double> out,
                                     const std::vector<SurfaceSide>* sides) const {
  constexpr Index block = embedding_block;
  const Index count = points.rows(), n = nodes.rows();
  RowMatrix<double> rows(n, embedding_row);
  rows << nodes, values, slopes;
  const double scale = 1.0 / (width * width);
  const int columns_count = columns(out.order);
  std::vector<SurfaceSide> found;
  if (sight && sides == nullptr) found = sight->sides_near(points), sides = &found;
  parallel_for(0, (count + block - 1) / block, 4, [&](Index first, Index last) {
    std::array<double, 3 * block> packed;
    std::array<double, 30 * block> jets;
    std::vector<std::int32_t> near(n);
    std::vector<double> distance(n), excess;
    std::vector<std::array<double, 10>> weights;
    std::vector<Index> slots(sight ? n : 0, -1);  // of the hidden nodes among those that are near
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
      double farthest_nearest = nearest + radius;
      const auto side_of = [&](Index i) {
        return sight ? (*sides)[static_cast<std::size_t>(b * block + std::min(i, valid - 1))]
                     : SurfaceSide{-1};
      };
      const auto for_hidden = [&](SurfaceSide node, const auto& visit) {
        for (std::int32_t k = sight->starts[node]; k < sight->starts[node + 1]; ++k)
          visit(sight->others[k], sight->excess[k]);
      };
      for (Index i = 0; sight && i < valid; ++i)
        if (const SurfaceSide side = side_of(i); side >= 0) {
          farthest_nearest = std::max(farthest_nearest, (part.row(i) - nodes.row(side)).norm());
          for (const std::int32_t node : sight->company(side))
            for_hidden(node, [&](std::int32_t other, double) { slots[other] = 0; });
        }
      const double cutoff =
          std::sqrt(farthest_nearest * farthest_nearest - negligible * width * width) + radius;
      Index near_count = 0;
      const auto add_near = [&](bool hidden) {
        for (Index j = 0; j < n; ++j)
          if (distance[j] <= cutoff && (sight && slots[j] >= 0) == hidden)
            near[near_count++] = static_cast<std::int32_t>(j);
      };
      if (sight) add_near(true);
      const Index hidden_count = near_count;
      add_near(false);
      if (sight) std::fill(slots.begin(), slots.end(), Index{-1});
      for (Index a = 0; a < hidden_count; ++a) slots[near[a]] = a;
      excess.assign(static_cast<std::size_t>(hidden_count * columns_count * block), 0.0);
      for (Index i = 0; i < block && hidden_count > 0; ++i) {
        const SurfaceSide side = side_of(i);
        if (side < 0) continue;
        const std::vector<std::int32_t>& company = sight->company(side);
        blend_weights(part.row(std::min(i, valid - 1)).transpose(), nodes, company, width, columns_count,
                      weights);
        for (std::size_t m = 0; m < company.size(); ++m)
          for_hidden(company[m], [&](std::int32_t other, double square) {
            const Index slot = slots[other];
            for (int c = 0; slot >= 0 && c < columns_count; ++c)
              excess[(slot * columns_count + c) * block + i] +=
                  weights[m][static_cast<std::size_t>(c)] * square;
          });
      }
      for (Index a = 0; a < hidden_count; ++a) slots[near[a]] = -1;
      const EmbeddingBlock embedding_block_data{packed.data(), rows.data(), near.data(),  near_count,
                                                hidden_count,  scale,       excess.data()};
      ARAPFIELDS_DISPATCH(embedding_jets(embedding_block_data, columns_count, jets.data()));
      for (int c = 0; c < columns_count; ++c)
        for (Index p = 0; p < valid; ++p)
          for (int k = 0; k < 3; ++k) out.at(c, b * block + p)[k] = jets[(c * 3 + k) * block + p];
    }
  });
}

namespace {

/// For each point (n,3) of a surface, with its normal, the nearest of the nodes that it sees.
struct SeenNodes {
  std::vector<Index> nodes;  ///< where a point sees none of those tried: the nearest one with a like normal
  Vector distances;          ///< infinity there
};

/// `nearest`: the node nearest to each point.
SeenNodes nearest_seen(PointsIn points, PointsIn normals, PointsIn nodes, PointsIn node_normals,
                       const std::vector<std::int32_t>& nearest, double width, const InsideSight& mesh) {
  const Index count = points.rows(), tried = std::min<Index>(most_tried, nodes.rows());
  const InsideSight::Eyes from = eyes_of(points, normals, width, mesh),
                          to = eyes_of(nodes, node_normals, width, mesh);
  SeenNodes result{std::vector<Index>(static_cast<std::size_t>(count)),
                   Vector::Constant(count, std::numeric_limits<double>::infinity())};
  std::vector<Index> left;
  // Takes the nodes that their points see; the points of the others are left.
  const auto look = [&](const std::vector<std::pair<Index, Index>>& pairs) {
    const std::vector<bool> seen = mesh.see(from, to, pairs);
    left.clear();
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const auto [i, node] = pairs[k];
      if (!seen[k]) {
        left.push_back(i);
        continue;
      }
      result.nodes[i] = node;
      result.distances[i] = (nodes.row(node) - points.row(i)).norm();
    }
  };
  std::vector<std::pair<Index, Index>> pairs;
  for (Index i = 0; i < count; ++i) pairs.emplace_back(i, nearest[static_cast<std::size_t>(i)]);
  look(pairs);
  // Few points do not see their nearest node: these try more, in the order of distance.
  const std::vector<Index> others = left;
  const Eigen::ArrayX3d columns = nodes;
  std::vector<Index> candidates(others.size() * static_cast<std::size_t>(tried));
  parallel_for(0, std::ssize(others), 16, [&](Index first, Index last) {
    Eigen::ArrayXd squares(nodes.rows());
    std::vector<Index> order(static_cast<std::size_t>(nodes.rows()));
    for (Index k = first; k < last; ++k) {
      const Index i = others[k];
      squares = (columns.col(0) - points(i, 0)).square() + (columns.col(1) - points(i, 1)).square() +
                (columns.col(2) - points(i, 2)).square();
      std::iota(order.begin(), order.end(), Index{0});
      std::partial_sort(order.begin(), order.begin() + tried, order.end(), [&](Index a, Index c) {
        return squares[a] != squares[c] ? squares[a] < squares[c] : a < c;
      });
      std::copy_n(order.begin(), tried, candidates.begin() + k * tried);
    }
  });
  const auto row_of = [&](Index i) {
    return std::lower_bound(others.begin(), others.end(), i) - others.begin();
  };
  for (Index round = 1; round < tried && !left.empty(); ++round) {
    pairs.clear();
    for (const Index i : left) pairs.emplace_back(i, candidates[row_of(i) * tried + round]);
    look(pairs);
  }
  for (const Index i : left) {
    const Index* const own = &candidates[row_of(i) * tried];
    const Index* const like = std::find_if(own, own + tried, [&](Index node) {
      return node_normals.row(node).dot(normals.row(i)) > like_cosine;
    });
    result.nodes[i] = like != own + tried ? *like : *own;
  }
  return result;
}

/// Rows of the samples that are farther than a width from all nodes that they see, among those near marked
/// nodes, chosen so that each of them sees a node within the width: two walls that face each other need nodes
/// of their own.
std::vector<Index> unseen_samples(PointsIn samples, PointsIn normals, const std::vector<Index>& chosen,
                                  const std::vector<bool>& marked, double width, const InsideSight& mesh) {
  std::vector<Index> near;
  for (Index i = 0; i < samples.rows(); ++i)
    for (std::size_t k = 0; k < chosen.size(); ++k)
      if (marked[k] && (samples.row(chosen[k]) - samples.row(i)).squaredNorm() < 4.0 * width * width) {
        near.push_back(i);
        break;
      }
  const Points places = samples(near, Eigen::all), directions = normals(near, Eigen::all);
  const Points nodes = samples(chosen, Eigen::all);
  Vector distances = nearest_seen(places, directions, nodes, normals(chosen, Eigen::all),
                                  nearest_samples(nodes).closest(places).triangles, width, mesh)
                         .distances;
  const InsideSight::Eyes eyes = eyes_of(places, directions, width, mesh);
  std::vector<Index> added;
  for (Index farthest = 0; !near.empty() && std::ssize(added) < most_nodes / 2;) {
    if (!(distances.maxCoeff(&farthest) > width)) break;
    added.push_back(near[farthest]);
    distances[farthest] = 0.0;
    std::vector<std::pair<Index, Index>> pairs;
    for (Index i = 0; i < places.rows(); ++i)
      if (distances[i] > width && (places.row(i) - places.row(farthest)).squaredNorm() < width * width)
        pairs.emplace_back(farthest, i);
    const std::vector<bool> seen = mesh.see(eyes, eyes, pairs);
    for (std::size_t k = 0; k < pairs.size(); ++k)
      if (const Index i = pairs[k].second; seen[k])
        distances[i] = (places.row(i) - places.row(farthest)).norm();
  }
  return added;
}

}  // namespace

std::vector<Index> InteriorEmbedding::near_walls(const std::vector<SurfaceSide>& nearest) const {
  std::vector<Index> result;
  for (std::size_t p = 0; p < nearest.size(); ++p)
    if (sight->is_doubtful(nearest[p])) result.push_back(static_cast<Index>(p));
  return result;
}

void InteriorEmbedding::look(const std::vector<Index>& rows, PointsIn points, PointsIn normals,
                             const InsideSight& mesh, std::vector<SurfaceSide>& sides) const {
  std::vector<SurfaceSide> nearest;
  for (const Index p : rows) nearest.push_back(sides[p]);
  const SeenNodes seen = nearest_seen(points(rows, Eigen::all), normals(rows, Eigen::all), nodes,
                                      sight->normals, nearest, width, mesh);
  for (std::size_t k = 0; k < rows.size(); ++k) sides[rows[k]] = static_cast<SurfaceSide>(seen.nodes[k]);
}

std::vector<SurfaceSide> InteriorEmbedding::own_sides_of(PointsIn points, PointsIn normals,
                                                         const InsideSight& mesh,
                                                         std::vector<Index>* doubtful) const {
  if (!sight) return std::vector<SurfaceSide>(static_cast<std::size_t>(points.rows()), -1);
  std::vector<SurfaceSide> result = sight->nearest_nodes(points);
  const std::vector<Index> near = near_walls(result);
  if (doubtful != nullptr) *doubtful = near;
  if (!near.empty()) look(near, points, normals, mesh, result);
  return result;
}

std::vector<SurfaceSide> InteriorEmbedding::sides_of(const TriangleMesh& mesh, const Frame& frame) const {
  if (!has_sides()) return std::vector<SurfaceSide>(static_cast<std::size_t>(mesh.vertices.rows()), -1);
  const auto is_known = [&](const TriangleMesh& other) {
    return mesh_ && mesh_->vertices.rows() == other.vertices.rows() &&
           mesh_->triangles.rows() == other.triangles.rows() && mesh_->vertices == other.vertices &&
           mesh_->triangles == other.triangles;
  };
  if (is_known(mesh)) return mesh_sides_;
  const TriangleMesh outward = facing_outwards(mesh);
  if (is_known(outward)) return mesh_sides_;
  return sides_of(outward, frame, InsideSight(outward, frame));
}

namespace {

/// Gives vertices, by their rows, the sides among a part's nodes that they have, of which the first has the
/// number `first`, where the part's share is above those of the parts before.
void take_sides(const EmbeddingPart& part, const std::vector<Index>& rows,
                const std::vector<SurfaceSide>& own, SurfaceSide first, std::vector<SurfaceSide>& sides,
                Vector& shares) {
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double share = part.share.values(own[k], 0);
    if (!(share > shares[rows[k]])) continue;
    shares[rows[k]] = share;
    sides[static_cast<std::size_t>(rows[k])] = first + own[k];
  }
}

/// The vertices in a part's ball, and the triangles between them.
TriangleMesh inside(const TriangleMesh& mesh, const std::vector<Index>& rows) {
  std::vector<std::int32_t> place(static_cast<std::size_t>(mesh.vertices.rows()), -1), corners;
  for (std::size_t k = 0; k < rows.size(); ++k)
    place[static_cast<std::size_t>(rows[k])] = static_cast<std::int32_t>(k);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return place[static_cast<std::size_t>(mesh.triangles(t, k))]; };
    if (corner(0) >= 0 && corner(1) >= 0 && corner(2) >= 0)
      corners.insert(corners.end(), {corner(0), corner(1), corner(2)});
  }
  return {mesh.vertices(rows, Eigen::all),
          Eigen::Map<const Triangles>(corners.data(), std::ssize(corners) / 3, 3)};
}

}  // namespace

std::vector<SurfaceSide> InteriorEmbedding::sides_of(const TriangleMesh& outward, const Frame& frame,
                                                     const InsideSight& mesh) const {
  std::vector<SurfaceSide> result = own_sides_of(outward, frame, mesh);
  Vector shares = Vector::Zero(outward.vertices.rows());
  auto first = static_cast<SurfaceSide>(nodes.rows());
  const Points places = frame.to_cube(outward.vertices);
  for (const EmbeddingPart& part : parts) {
    const std::vector<Index> rows = part.ball.rows_inside(places);
    if (part.embedding.sight && !rows.empty()) {
      take_sides(part, rows, part.embedding.own_sides_of(inside(outward, rows), frame, mesh), first, result,
                 shares);
    }
    first += static_cast<SurfaceSide>(part.embedding.nodes.rows());
  }
  return result;
}

void SidedPlaces::add(PointsIn more, PointsIn their_normals, PointsIn their_places,
                      const Vector& their_shares) {
  const auto append = [&](Points& to, PointsIn rows) {
    to.conservativeResize(to.rows() + rows.rows(), Eigen::NoChange);
    to.bottomRows(rows.rows()) = rows;
  };
  append(points, more);
  append(normals, their_normals);
  append(places, their_places);
  shares.conservativeResize(points.rows());
  if (their_shares.size() > 0)
    shares.tail(more.rows()) = their_shares;
  else
    shares.tail(more.rows()).setZero();
}

SidedPlaces SidedPlaces::rows(const std::vector<Index>& chosen) const {
  return {points(chosen, Eigen::all), normals(chosen, Eigen::all), places(chosen, Eigen::all),
          shares(chosen)};
}

void InteriorEmbedding::look_at(const SidedPlaces& samples, std::shared_ptr<const TriangleMesh> mesh,
                                const Frame& frame, const InsideSight& inside_sight) {
  const auto know = [&](const InteriorEmbedding& own, const SidedPlaces& known, const TriangleMesh& of) {
    std::vector<Index> near, near_vertices;
    const std::vector<SurfaceSide> of_points =
        own.own_sides_of(known.points, known.normals, inside_sight, &near);
    std::vector<SurfaceSide> of_vertices = own.own_sides_of(of, frame, inside_sight, &near_vertices);
    Points places(std::ssize(near) + std::ssize(near_vertices), 3);
    places << known.places(near, Eigen::all), frame.to_cube(Points(of.vertices(near_vertices, Eigen::all)));
    std::vector<SurfaceSide> sides;
    for (const Index i : near) sides.push_back(of_points[static_cast<std::size_t>(i)]);
    for (const Index i : near_vertices) sides.push_back(of_vertices[static_cast<std::size_t>(i)]);
    own.sight->set_places(places, std::move(sides));
    return of_vertices;
  };
  mesh_sides_.assign(static_cast<std::size_t>(mesh->vertices.rows()), -1);
  if (sight) {
    std::vector<Index> beside_parts;
    for (Index i = 0; i < samples.shares.size(); ++i)
      if (samples.shares[i] < 1.0) beside_parts.push_back(i);
    mesh_sides_ = know(*this, samples.rows(beside_parts), *mesh);
  }
  const Points vertices = frame.to_cube(mesh->vertices);
  Vector shares = Vector::Zero(vertices.rows());
  auto first = static_cast<SurfaceSide>(nodes.rows());
  for (EmbeddingPart& part : parts) {
    if (sight && part.embedding.sight)
      part.sides = own_sides_of(part.embedding.nodes, part.embedding.sight->normals, inside_sight);
    if (part.embedding.sight) {
      const std::vector<Index> of_mesh = part.ball.rows_inside(vertices);
      const SidedPlaces known = samples.rows(part.ball.rows_inside(samples.points));
      take_sides(part, of_mesh, know(part.embedding, known, inside(*mesh, of_mesh)), first, mesh_sides_,
                 shares);
    }
    first += static_cast<SurfaceSide>(part.embedding.nodes.rows());
  }
  mesh_ = std::move(mesh);
}

std::vector<SurfaceSide> InteriorEmbedding::own_sides_of(const TriangleMesh& outward, const Frame& frame,
                                                         const InsideSight& mesh,
                                                         std::vector<Index>* doubtful) const {
  if (!sight) return std::vector<SurfaceSide>(static_cast<std::size_t>(outward.vertices.rows()), -1);
  const Points places = frame.to_cube(outward.vertices);
  std::vector<SurfaceSide> result = sight->nearest_nodes(places);
  const std::vector<Index> near = near_walls(result);
  if (doubtful != nullptr) *doubtful = near;
  if (near.empty()) return result;
  // Vertices in one place that triangles join, as along a seam, are looked at as one.
  const std::vector<std::int32_t> joined = joined_vertices(outward);
  TriangleMesh seamless = outward;
  for (std::int32_t& corner : seamless.triangles.reshaped()) corner = joined[corner];
  std::vector<Index> looked;
  std::vector<bool> is_near(result.size(), false);
  for (const Index v : near) {
    is_near[static_cast<std::size_t>(v)] = true;
    if (joined[v] == v) looked.push_back(v);
  }
  look(looked, places, vertex_normals(seamless), mesh, result);
  std::vector<std::vector<std::int32_t>> beside(result.size());
  for (Index t = 0; t < seamless.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const std::int32_t a = seamless.triangles(t, k), b = seamless.triangles(t, (k + 1) % 3);
      if (!is_near[a] || !is_near[b] || (places.row(a) - places.row(b)).squaredNorm() > width * width)
        continue;
      beside[a].push_back(b);
      beside[b].push_back(a);
    }
  const auto torn = [&](Index v, SurfaceSide side) {
    return std::count_if(beside[v].begin(), beside[v].end(), [&](std::int32_t other) {
      return result[other] != side && sight->hides(result[other], side);
    });
  };
  // A vertex takes a neighbour's side where fewer of its edges are then torn. At the end of a slit some are
  // for good; the line between the sides stays there.
  bool changed = true;
  for (int round = 0; changed && round < most_rounds; ++round) {
    changed = false;
    for (const Index v : looked) {
      auto least = torn(v, result[v]);
      for (const std::int32_t other : beside[v]) {
        if (least == 0) break;
        const SurfaceSide side = result[other];
        if (const auto left = torn(v, side); left < least) {
          least = left;
          result[v] = side;
          changed = true;
        }
      }
    }
  }
  for (const Index v : near) result[v] = result[joined[v]];
  return result;
}

namespace {

/// Marks the nodes near which parts of the shape nearly touch.
std::vector<bool> near_other_parts(const Points& nodes, const Points& normals, PointsIn samples,
                                   PointsIn sample_normals, double width, double near) {
  std::vector<char> faces(static_cast<std::size_t>(nodes.rows()));
  parallel_for(0, nodes.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < samples.rows() && faces[i] == 0; ++j) {
        const Eigen::RowVector3d way = samples.row(j) - nodes.row(i);
        faces[i] = way.squaredNorm() < near * near && way.dot(normals.row(i)) > -facing_behind * width &&
                   normals.row(i).dot(sample_normals.row(j)) < facing_cosine;
      }
  });
  std::vector<bool> result(faces.size());
  const double reach = sight_widths * width;
  for (Index i = 0; i < nodes.rows(); ++i)
    for (Index j = 0; j < nodes.rows() && !result[i]; ++j)
      result[i] = faces[j] != 0 && (nodes.row(i) - nodes.row(j)).squaredNorm() < reach * reach;
  return result;
}

/// Pairs of marked nodes, near each other, that do not see each other: a list for each node.
Neighbours hidden_pairs(const Points& nodes, const Points& normals, const std::vector<bool>& marked,
                        double width, const InsideSight& mesh) {
  const double reach = sight_widths * width;
  std::vector<std::pair<Index, Index>> pairs;
  for (Index i = 0; i < nodes.rows(); ++i)
    for (Index j = i + 1; marked[i] && j < nodes.rows(); ++j)
      if (marked[j] && (nodes.row(i) - nodes.row(j)).squaredNorm() < reach * reach) pairs.emplace_back(i, j);
  const InsideSight::Eyes eyes = eyes_of(nodes, normals, width, mesh);
  const std::vector<bool> seen = mesh.see(eyes, eyes, pairs);
  Neighbours hidden(static_cast<std::size_t>(nodes.rows()));
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (!seen[k])
      hidden[pairs[k].first].push_back(pairs[k].second), hidden[pairs[k].second].push_back(pairs[k].first);
  for (auto& list : hidden) std::sort(list.begin(), list.end());
  return hidden;
}

/// Takes into the sight the interior distances of the pairs that do not see each other.
void measure(const InteriorGraph& graph, const Points& nodes, const Neighbours& hidden, double width,
             NodeSight& sight) {
  const auto longest = static_cast<float>(longest_widths * width);
  std::vector<std::vector<double>> excess(hidden.size());
  parallel_for(0, nodes.rows(), 8, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      if (hidden[i].empty()) continue;
      std::vector<float> start(hidden.size(), std::numeric_limits<float>::infinity());
      start[i] = 0.0f;
      const std::vector<float> lengths = graph.distances_from(std::move(start), longest);
      for (const Index j : hidden[i]) {
        const double inside = detour * std::min(lengths[j], longest);
        const double square = (nodes.row(i) - nodes.row(j)).squaredNorm();
        const double beyond = (inside / std::sqrt(square) - bend_ratio) / (gap_ratio - bend_ratio);
        excess[i].push_back(std::clamp(beyond, 0.0, 1.0) * std::max(0.0, inside * inside - square));
      }
    }
  });
  sight.starts.assign(1, 0);
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    for (std::size_t k = 0; k < hidden[i].size(); ++k)
      if (excess[i][k] > 0.0) {
        sight.others.push_back(static_cast<std::int32_t>(hidden[i][k]));
        sight.excess.push_back(excess[i][k]);
      }
    sight.starts.push_back(static_cast<std::int32_t>(sight.others.size()));
  }
}

}  // namespace

namespace {

/// A fine region whose embedding is made, with ψ of the whole (n,3) at its points.
struct RegionOfWhole {
  const FineRegion& region;
  Points known;
  InteriorEmbedding share = {};  // that is made
};

/// interior_embedding(), or that of a part.
std::shared_ptr<InteriorEmbedding> made_embedding(PointsIn samples, PointsIn normals, int axis,
                                                  const MayJoin& may_join, const MakeSight& make_sight,
                                                  RegionOfWhole* part) {
  if (samples.rows() < least_nodes || normals.rows() != samples.rows()) return nullptr;
  const Index most = axis < 0 ? most_nodes : most_nodes / 2;
  const FarthestPoints chosen =
      farthest_points(samples, std::min<Index>(most, part ? samples.rows() / points_a_node : samples.rows()));
  if (static_cast<Index>(chosen.indices.size()) < least_nodes || !(chosen.fill_distance > 0.0))
    return nullptr;
  InteriorEmbedding embedding;
  embedding.width = chosen.fill_distance;
  const double facing = (part ? part_facing_widths : facing_widths) * embedding.width;
  // Where parts of the shape nearly touch, no edge of the graph crosses the surface.
  std::vector<Index> rows = chosen.indices;
  std::shared_ptr<const InsideSight> mesh;
  Points others(0, 3), other_normals(0, 3);
  if (make_sight) {
    others = samples;
    other_normals = normals;
    if (axis >= 0) {
      others.conservativeResize(2 * samples.rows(), 3);
      other_normals.conservativeResize(2 * samples.rows(), 3);
      others.bottomRows(samples.rows()) = samples;
      other_normals.bottomRows(samples.rows()) = normals;
      others.col(axis).tail(samples.rows()) *= -1.0;
      other_normals.col(axis).tail(samples.rows()) *= -1.0;
    }
    const std::vector<bool> marked = near_other_parts(samples(rows, Eigen::all), normals(rows, Eigen::all),
                                                      others, other_normals, embedding.width, facing);
    if (std::find(marked.begin(), marked.end(), true) != marked.end()) mesh = make_sight();
    if (mesh) {
      const std::vector<Index> added = unseen_samples(samples, normals, rows, marked, embedding.width, *mesh);
      rows.insert(rows.end(), added.begin(), added.end());
    }
  }
  embedding.nodes = samples(rows, Eigen::all);
  Points node_normals = normals(rows, Eigen::all);
  std::vector<Index> twins;
  if (axis >= 0) twins = add_reflections(embedding.nodes, node_normals, axis, embedding.width);
  const Index n = embedding.nodes.rows();
  // Landmarks are the first nodes, in complete mirrored pairs.
  const Index count = landmarks + (axis >= 0 && twins[landmarks - 1] == landmarks ? 1 : 0);
  const MayJoin rows_may_join = [&](Index i, Index j) { return may_join(rows[i], rows[j]); };
  Neighbours hidden;
  if (mesh) {
    embedding.sight = std::make_shared<NodeSight>();
    embedding.sight->reach = sight_widths * embedding.width;
    embedding.sight->normals = node_normals;
    hidden = hidden_pairs(
        embedding.nodes, node_normals,
        near_other_parts(embedding.nodes, node_normals, others, other_normals, embedding.width, facing),
        embedding.width, *mesh);
  }
  const MayJoin nodes_may_join = [&](Index i, Index j) {
    return (!may_join || rows_may_join(i, j)) &&
           (hidden.empty() || !std::binary_search(hidden[i].begin(), hidden[i].end(), j));
  };
  const InteriorGraph graph(embedding.nodes, node_normals, embedding.width,
                            may_join || mesh ? nodes_may_join : MayJoin());
  if (embedding.sight) {
    measure(graph, embedding.nodes, hidden, embedding.width, *embedding.sight);
    if (embedding.sight->others.empty())
      embedding.sight = nullptr;
    else
      embedding.sight->set_nodes(embedding.nodes, embedding.width);
  }
  RowMatrix<double> straight(n, count);
  for (Index i = 0; i < n; ++i)
    for (Index l = 0; l < count; ++l)
      straight(i, l) = (embedding.nodes.row(i) - embedding.nodes.row(l)).squaredNorm();
  const RowMatrix<double> excess =
      ((detour * graph.distances(count)).array().square() - straight.array()).cwiseMax(0.0);
  embedding.values = classical_scaling(excess);
  if (part) {
    const double near = stress_widths * embedding.width;
    reduce_stress(excess, (straight.array() + near * near).square().inverse(), embedding.values);
  }
  embedding.values *= std::sqrt(emphasis);
  Neighbours neighbours(n);
  const float cutoff = static_cast<float>(neighbour_spacings * embedding.width);
  for (Index i = 0; i < n; ++i)
    for (const InteriorGraph::Edge& edge : graph.edges(i))
      if (edge.length < cutoff) neighbours[i].push_back(edge.to);
  embedding.values = smoothed(embedding.values, neighbours, part ? part_smoothing : smoothing);
  if (part) {  // where the part ends, its values are those of the whole on average
    const Vector outside = 1.0 - part->region.shares(rows).array();
    const Points away = part->known(rows, Eigen::all) - embedding.values;
    embedding.values.rowwise() += outside.transpose() * away / std::max(outside.sum(), 1e-12);
  }
  const double size =
      (embedding.nodes.colwise().maxCoeff() - embedding.nodes.colwise().minCoeff()).maxCoeff();
  const Eigen::RowVector3d middle = embedding.values.colwise().mean();
  const double spread =
      (embedding.values.rowwise() - middle).colwise().squaredNorm().maxCoeff() / static_cast<double>(n);
  if (spread < worthwhile_spread * worthwhile_spread * size * size && !embedding.sight && !part)
    return nullptr;
  embedding.slopes = fitted_slopes(embedding.nodes, embedding.values, neighbours);
  if (axis >= 0) symmetrise(embedding, twins, axis);
  if (part) {
    part->share = embedding;
    part->share.values.setZero();
    part->share.values.col(0) = part->region.shares(rows);
    part->share.slopes = fitted_slopes(embedding.nodes, part->share.values, neighbours);
  }
  return std::make_shared<InteriorEmbedding>(std::move(embedding));
}

}  // namespace

std::shared_ptr<InteriorEmbedding> interior_embedding(PointsIn samples, PointsIn normals, int axis,
                                                      const MayJoin& may_join, const MakeSight& make_sight) {
  return made_embedding(samples, normals, axis, may_join, make_sight, nullptr);
}

namespace {

/// ±1: whether the coordinates of ψ are even or odd across the plane, by their values at points (n,3).
Vec3 parity(const InteriorEmbedding& whole, Points points, int axis) {
  Points here(points.rows(), 3), there = here;
  whole.evaluate(points, {here.data(), here.rows(), JetOrder::value});
  points.col(axis) *= -1.0;
  whole.evaluate(points, {there.data(), there.rows(), JetOrder::value});
  Vec3 result;
  for (int k = 0; k < 3; ++k) result[k] = here.col(k).dot(there.col(k)) < 0.0 ? -1.0 : 1.0;
  return result;
}

/// The reflection of a part's function, whose coordinates change by these signs.
InteriorEmbedding reflected(const InteriorEmbedding& of, int axis, const Vec3& signs) {
  InteriorEmbedding result = of;
  result.nodes.col(axis) *= -1.0;
  for (int k = 0; k < 3; ++k) {
    result.values.col(k) *= signs[k];
    for (int i = 0; i < 3; ++i) result.slopes.col(3 * k + i) *= i == axis ? -signs[k] : signs[k];
  }
  if (!of.sight) return result;
  result.sight = std::make_shared<NodeSight>(*of.sight);
  result.sight->normals.col(axis) *= -1.0;
  result.sight->set_nodes(result.nodes, result.width);
  return result;
}

}  // namespace

void add_parts(InteriorEmbedding& whole, const std::vector<FineRegion>& regions, const MakeSight& make_sight,
               int axis, const Progress& progress) {
  std::vector<EmbeddingPart> parts;
  for (const FineRegion& region : regions) {
    progress.check();
    RegionOfWhole part{region, Points(region.points.rows(), 3)};
    whole.evaluate(region.points, {part.known.data(), part.known.rows(), JetOrder::value});
    const auto made = made_embedding(region.points, region.normals, -1, {}, make_sight, &part);
    if (!made) continue;
    parts.push_back({*made, part.share, {}, region.ball});
    if (axis < 0) continue;
    EmbeddingPart twin{reflected(*made, axis, parity(whole, region.points, axis)),
                       reflected(part.share, axis, Vec3::Ones()),
                       {},
                       region.ball};
    twin.share.sight = twin.embedding.sight;
    twin.ball.center[axis] *= -1.0;
    parts.push_back(std::move(twin));
  }
  for (EmbeddingPart& part : parts)
    part.sides.assign(static_cast<std::size_t>(part.embedding.nodes.rows()), -1);
  whole.parts = std::move(parts);
}

}  // namespace arapfields
