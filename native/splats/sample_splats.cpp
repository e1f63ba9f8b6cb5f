// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/sample_splats.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>
#include <unordered_map>

#include "core/errors.h"

namespace arapfields {
namespace {

constexpr float opaque_logit = 0.0f;          // opacity 1/2
constexpr Index fewest = 10;                  // opaque splats
constexpr double smallest_part = 0.01;        // of the samples
constexpr int reach = 2;                      // cells in each direction that are neighbours
constexpr int halvings = 40;                  // of the interval in which the cells' size is looked for
constexpr std::int64_t most_cells = 1 << 20;  // along an axis

/// Opaque splats in the cells of a grid.
class Cells {
 public:
  using Cell = std::array<std::int64_t, 3>;

  Cells(const GaussianSplats& splats, const std::vector<Index>& rows, const Vec3& low, double side) {
    for (const Index row : rows) {
      const Vec3 place = (splats.centers.row(row).cast<double>().transpose() - low) / side;
      const Cell cell{std::llround(std::floor(place[0])), std::llround(std::floor(place[1])),
                      std::llround(std::floor(place[2]))};
      const auto [found, is_new] = numbers_.emplace(key(cell), static_cast<Index>(cells_.size()));
      if (is_new) cells_.push_back(cell), rows_.emplace_back();
      rows_[static_cast<std::size_t>(found->second)].push_back(row);
    }
  }
  Index size() const { return static_cast<Index>(cells_.size()); }
  const std::vector<Index>& rows(Index i) const { return rows_[static_cast<std::size_t>(i)]; }
  /// Calls visit(number) for the other occupied cells near one.
  template <class Visit>
  void for_neighbours(Index i, int distance, Visit&& visit) const {
    const Cell& center = cells_[static_cast<std::size_t>(i)];
    for (int x = -distance; x <= distance; ++x)
      for (int y = -distance; y <= distance; ++y)
        for (int z = -distance; z <= distance; ++z) {
          const auto found = numbers_.find(key({center[0] + x, center[1] + y, center[2] + z}));
          if (found != numbers_.end() && found->second != i) visit(found->second);
        }
  }

 private:
  static std::uint64_t key(const Cell& cell) {
    std::uint64_t result = 0;
    for (const std::int64_t c : cell) result = (result << 21) | static_cast<std::uint64_t>(c + reach);
    return result;
  }

  std::unordered_map<std::uint64_t, Index> numbers_;
  std::vector<Cell> cells_;
  std::vector<std::vector<Index>> rows_;
};

/// The finest grid with at most `count` occupied cells.
Cells gridded(const GaussianSplats& splats, const std::vector<Index>& rows, Index count,
              const Progress& progress) {
  Vec3 low = splats.centers.row(rows.front()).cast<double>(), high = low;
  for (const Index row : rows) {
    const Vec3 place = splats.centers.row(row).cast<double>();
    low = low.cwiseMin(place), high = high.cwiseMax(place);
  }
  const double extent = (high - low).maxCoeff();
  require(extent > 0.0, "splats", "all opaque centers are one point", "a surface is needed");
  double coarse = extent, fine = extent / static_cast<double>(most_cells);
  for (int i = 0; i < halvings && coarse > 1.02 * fine; ++i) {
    progress.report(i / double{halvings});
    const double middle = std::sqrt(coarse * fine);
    (Cells(splats, rows, low, middle).size() > count ? fine : coarse) = middle;
  }
  return Cells(splats, rows, low, coarse);
}

/// One sample a cell.
struct Surface {
  Points points, normals;
  std::vector<Index> parts;  // of each sample, by its number
};

/// The splat of each cell nearest to the mean of its centers, and the direction most of the shortest axes
/// near it agree on. Flat splats count more.
Surface representatives(const GaussianSplats& splats, const Cells& cells) {
  const Index count = cells.size();
  std::vector<Mat3> sums(static_cast<std::size_t>(count), Mat3::Zero());
  Surface surface{Points(count, 3), Points(count, 3), {}};
  for (Index i = 0; i < count; ++i) {
    Vec3 mean = Vec3::Zero();
    for (const Index row : cells.rows(i)) {
      mean += splats.centers.row(row).cast<double>() / static_cast<double>(cells.rows(i).size());
      Eigen::Index axis = 0;
      Vec3 scales = splats.log_scales.row(row).cast<double>();
      scales.minCoeff(&axis);
      const Vec3 normal = axes_of(splats.rotations.row(row)).col(axis);
      std::sort(scales.data(), scales.data() + 3);
      sums[static_cast<std::size_t>(i)] +=
          (1.0 - std::exp(scales[0] - scales[1])) * normal * normal.transpose();
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (const Index row : cells.rows(i)) {
      const Vec3 center = splats.centers.row(row).cast<double>();
      if ((center - mean).squaredNorm() < nearest)
        nearest = (center - mean).squaredNorm(), surface.points.row(i) = center;
    }
  }
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  for (Index i = 0; i < count; ++i) {
    Mat3 sum = sums[static_cast<std::size_t>(i)];
    cells.for_neighbours(i, 1, [&](Index j) { sum += 0.25 * sums[static_cast<std::size_t>(j)]; });
    solver.computeDirect(sum);
    surface.normals.row(i) = solver.eigenvectors().col(2).normalized();
  }
  return surface;
}

/// Makes the normals of the part that holds `root` agree: along the tree that grows from there over the most
/// parallel neighbours. The samples of the part.
std::vector<Index> agreed(const Cells& cells, Surface& surface, Index root, Index part) {
  using Edge = std::tuple<double, Index, Index>;  // agreement, from, to
  std::priority_queue<Edge> edges;
  std::vector<Index> reached;
  const auto take = [&](Index i) {
    surface.parts[static_cast<std::size_t>(i)] = part;
    reached.push_back(i);
    cells.for_neighbours(i, reach, [&](Index j) {
      if (surface.parts[static_cast<std::size_t>(j)] < 0)
        edges.emplace(std::abs(surface.normals.row(i).dot(surface.normals.row(j))), i, j);
    });
  };
  take(root);
  while (!edges.empty()) {
    const auto [agreement, from, to] = edges.top();
    edges.pop();
    if (surface.parts[static_cast<std::size_t>(to)] >= 0) continue;
    if (surface.normals.row(from).dot(surface.normals.row(to)) < 0.0) surface.normals.row(to) *= -1.0;
    take(to);
  }
  return reached;
}

/// Turns a part's normals outward: in each direction of a cube's faces, edges and corners, the outermost
/// sample's points that way.
void turn_outward(Surface& surface, const std::vector<Index>& part) {
  double votes = 0.0;
  for (int code = 0; code < 27; ++code) {
    const Vec3 direction(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
    Index outermost = part.front();
    for (const Index i : part)
      if ((surface.points.row(i) - surface.points.row(outermost)).dot(direction.transpose()) > 0.0)
        outermost = i;
    votes += surface.normals.row(outermost).dot(direction.transpose());
  }
  if (votes < 0.0)
    for (const Index i : part) surface.normals.row(i) *= -1.0;
}

}  // namespace

SurfaceSamples sample_splats(const GaussianSplats& splats, Index count, const Progress& progress) {
  splats.validate();
  require(count >= fewest, "count", std::to_string(count), "10 at least are needed");
  std::vector<Index> rows;
  for (Index i = 0; i < splats.size(); ++i)
    if (splats.opacity_logits[i] >= opaque_logit) rows.push_back(i);
  require(static_cast<Index>(rows.size()) >= fewest, "splats", std::to_string(rows.size()) + " are opaque",
          "at least 10 of opacity 1/2 are needed");
  // With a splat or two a cell, cells of one sheet are neighbours.
  const Index most = std::min(count, static_cast<Index>(rows.size()) / 2 + 1);
  const Cells cells = gridded(splats, rows, most, progress.part(0.0, 0.8));
  Surface surface = representatives(splats, cells);
  surface.parts.assign(static_cast<std::size_t>(cells.size()), -1);
  std::vector<Index> kept;
  for (Index root = 0, part = 0; root < cells.size(); ++root) {
    if (surface.parts[static_cast<std::size_t>(root)] >= 0) continue;
    progress.check();
    const std::vector<Index> samples = agreed(cells, surface, root, part++);
    if (static_cast<double>(samples.size()) < smallest_part * static_cast<double>(cells.size())) continue;
    turn_outward(surface, samples);
    kept.insert(kept.end(), samples.begin(), samples.end());
  }
  require(static_cast<Index>(kept.size()) >= fewest, "splats", "no part of them is a surface",
          "neighbouring splats are needed");
  const Points points = surface.points(kept, Eigen::all), normals = surface.normals(kept, Eigen::all);
  SurfaceSamples samples;
  samples.frame = Frame::balanced(points, Vector::Ones(points.rows()));
  samples.points = samples.frame.to_cube(points);
  samples.normals = normals;
  return samples;
}

}  // namespace arapfields
