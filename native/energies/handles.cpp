// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/handles.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "energies/rotation.h"

namespace arapfields {
namespace {

constexpr double rigid_tolerance = 1e-3;
/// Lengths whose volumes doubles hold, by far: this and its inverse.
constexpr double shortest = 1e-100;
/// Volume of a target's box over the cube of its longest edge, below which it counts as flat.
constexpr double least_volume = 1e-9;

std::string name_of(Index index) { return "handles[" + std::to_string(index) + "]"; }

bool is_affine(const Mat4& m) { return (m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-6; }

std::vector<Index> members_of(const Handle& handle, Index index, PointsIn samples) {
  std::vector<Index> members;
  if (handle.kind == Handle::Kind::region) {
    for (const Index i : handle.samples) {
      require(i >= 0 && i < samples.rows(), name_of(index), "sample index " + std::to_string(i),
              "indices below " + std::to_string(samples.rows()) + " are allowed");
      members.push_back(i);
    }
    require(!members.empty(), name_of(index), "its region lists no sample", "at least one is needed");
    return members;
  }
  const Mat4 inverse = handle.rest.inverse();
  const Points local = (samples * inverse.topLeftCorner<3, 3>().transpose()).rowwise() +
                       inverse.topRightCorner<3, 1>().transpose();
  for (Index i = 0; i < samples.rows(); ++i)
    if (local.row(i).cwiseAbs().maxCoeff() <= 1.0) members.push_back(i);
  require(!members.empty(), name_of(index), "its box holds no surface sample",
          "the box must overlap the surface at rest");
  return members;
}

}  // namespace

Handle Handle::in_cube(const Frame& frame) const {
  Handle result = *this;
  result.rest = frame.placement_to_cube(rest);
  result.target = frame.placement_to_cube(target);
  result.rest_point = (rest_point - frame.center) / frame.scale;
  result.target_point = (target_point - frame.center) / frame.scale;
  result.reach = reach / frame.scale;
  return result;
}

Mat4 Handle::motion(Index index) const {
  Mat4 result = Mat4::Identity();
  if (kind == Kind::point) {
    require(rest_point.allFinite() && target_point.allFinite(), name_of(index), "NaN or infinite coordinates",
            "both points must be finite");
    result.topRightCorner<3, 1>() = target_point - rest_point;
    return result;
  }
  require(rest.allFinite() && target.allFinite(), name_of(index), "NaN or infinite entries",
          "both matrices must be finite");
  require(is_affine(rest) && is_affine(target), name_of(index), "a last row other than 0 0 0 1",
          "both matrices must be affine");
  const Mat3 box = rest.topLeftCorner<3, 3>();
  const double extent = box.colwise().stableNorm().maxCoeff();
  require(extent < 1.0 / shortest && (extent == 0.0 || extent > shortest), name_of(index),
          "its rest box has a side of " + number_text(extent),
          number_text(shortest) + " to " + number_text(1.0 / shortest) + " is allowed");
  require(extent > 0.0 && std::abs(box.determinant()) > 1e-12 * extent * extent * extent, name_of(index),
          "its rest box is flat", "the rest pose needs a volume");
  const Mat3 linear = target.topLeftCorner<3, 3>() * box.inverse();
  if (allow_scale) {
    const double largest = linear.colwise().norm().maxCoeff();
    require(linear.allFinite() && std::abs(linear.determinant()) > least_volume * largest * largest * largest,
            name_of(index), "its target is flat", "a target with a volume is needed");
    require(linear.determinant() > 0.0, name_of(index), "its target mirrors the rest pose",
            "turning, moving, scaling and shearing are allowed");
    result.topLeftCorner<3, 3>() = linear;
    result.topRightCorner<3, 1>() = target.topRightCorner<3, 1>() - linear * rest.topRightCorner<3, 1>();
    return result;
  }
  require(linear.determinant() > 0.0, name_of(index), "its target mirrors the rest pose",
          "a rigid motion (rotation and translation) is allowed");
  const double deviation = (linear.transpose() * linear - Mat3::Identity()).cwiseAbs().maxCoeff();
  require(deviation <= rigid_tolerance, name_of(index),
          "its target scales or shears the rest pose by " + std::to_string(deviation),
          "a rigid motion (rotation and translation) is allowed, and more with allow_scale");
  const Mat3 rotation = closest_rotation(linear);
  result.topLeftCorner<3, 3>() = rotation;
  result.topRightCorner<3, 1>() = target.topRightCorner<3, 1>() - rotation * rest.topRightCorner<3, 1>();
  return result;
}

BoundHandles::BoundHandles(std::vector<Handle> handles, PointsIn samples) : handles_(std::move(handles)) {
  for (Index i = 0; i < count(); ++i) {
    const Handle& handle = handles_[i];
    require(std::isfinite(handle.weight) && handle.weight > 0.0, name_of(i) + ".weight",
            std::to_string(handle.weight), "must be positive");
    require_not_negative(name_of(i) + ".reach", handle.reach);
    motions_.push_back(handle.motion(i));
    if (handle.kind == Handle::Kind::point) {
      members_.push_back(-1);
    } else {
      const std::vector<Index> members = members_of(handle, i, samples);
      members_.insert(members_.end(), members.begin(), members.end());
    }
    begin_.push_back(static_cast<Index>(members_.size()));
  }
  sources_.resize(members_.size(), 3);
  targets_.resize(sources_.rows(), 3);
  brought_.assign(handles_.size(), 0.0);
  for (Index i = 0; i < count(); ++i) {
    for (Index p = begin(i); p < begin(i + 1); ++p) {
      const Index member = members_[p];
      if (member < 0)
        sources_.row(p) = place_of(i, samples).transpose();
      else
        sources_.row(p) = samples.row(member);
    }
    move(i);
  }
}

/// The material point of point handle i: its rest point, or the nearest sample.
Vec3 BoundHandles::place_of(Index i, PointsIn samples) {
  const Vec3& point = handle(i).rest_point;
  if (samples.rows() == 0) return point;
  const Eigen::RowVector3d low = samples.colwise().minCoeff(), high = samples.colwise().maxCoeff();
  const double size = (high - low).maxCoeff();
  if ((point.transpose().array() >= low.array()).all() && (point.transpose().array() <= high.array()).all())
    return point;
  Index nearest = 0;
  const double distance =
      std::sqrt((samples.rowwise() - point.transpose()).rowwise().squaredNorm().minCoeff(&nearest));
  if (!(distance > beside * size) || !(size > 0.0)) return point;
  require(distance <= farthest * size, name_of(i),
          "its point lies " + number_text(distance / size) + " times the shape's size away from it",
          "within " + number_text(farthest) + " of the size it is brought onto the surface");
  brought_[static_cast<std::size_t>(i)] = distance / size;
  return samples.row(nearest);
}

void BoundHandles::move(Index i) {
  const Mat4& motion = motions_[i];
  const Index rows = begin(i + 1) - begin(i);
  targets_.middleRows(begin(i), rows) =
      (sources_.middleRows(begin(i), rows) * motion.topLeftCorner<3, 3>().transpose()).rowwise() +
      motion.topRightCorner<3, 1>().transpose();
}

void BoundHandles::retarget(const std::vector<Handle>& moved) {
  require(static_cast<Index>(moved.size()) == count(), "targets", std::to_string(moved.size()) + " handles",
          std::to_string(count()) + " are bound");
  std::vector<Handle> next = handles_;
  std::vector<Mat4> motions(handles_.size());
  for (std::size_t i = 0; i < moved.size(); ++i) {
    next[i].target = moved[i].target;
    next[i].target_point = moved[i].target_point;
    motions[i] = next[i].motion(static_cast<Index>(i));
  }
  handles_ = std::move(next);
  motions_ = std::move(motions);
  for (Index i = 0; i < count(); ++i) move(i);
}

template <class Scalar>
HandleBatch<Scalar> BoundHandles::batch(Index per_handle, Random& random) const {
  std::vector<Index> rows;
  std::vector<double> weights;
  for (Index i = 0; i < count(); ++i) {
    const Index members = begin(i + 1) - begin(i);
    const Index taken = per_handle > 0 ? std::min(members, per_handle) : members;
    for (Index k = 0; k < taken; ++k) {
      rows.push_back(begin(i) + (taken == members ? k : random.below(members)));
      weights.push_back(handle(i).weight / static_cast<double>(taken * count()));
    }
  }
  HandleBatch<Scalar> result;
  const Index total = static_cast<Index>(rows.size());
  result.sources.resize(total, 3);
  result.targets.resize(total, 3);
  result.weights.resize(total);
  for (Index p = 0; p < total; ++p) {
    const Index row = rows[p];
    result.sources.row(p) = sources_.row(row).cast<Scalar>();
    result.targets.row(p) = targets_.row(row).cast<Scalar>();
    result.weights[p] = static_cast<Scalar>(weights[p]);
  }
  return result;
}

template <class Scalar>
HandleBatch<Scalar> BoundHandles::all() const {
  Random unused(0);
  return batch<Scalar>(0, unused);
}

template <class Scalar>
double handle_energy(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch, double weight,
                     JetView<Scalar> cotangents) {
  require(jets.count == batch.sources.rows(), "jets", std::to_string(jets.count) + " points",
          "the batch has " + std::to_string(batch.sources.rows()));
  require(cotangents.data == nullptr || cotangents.count == jets.count, "cotangents", "another count",
          "as many points as the jets' are needed");
  double value = 0.0;
  for (Index p = 0; p < jets.count; ++p) {
    for (int i = 0; i < 3; ++i) {
      const double difference =
          static_cast<double>(jets.at(0, p)[i]) - static_cast<double>(batch.targets(p, i));
      const double scaled = static_cast<double>(batch.weights[p]) * difference;
      value += scaled * difference;
      if (cotangents.data != nullptr) cotangents.at(0, p)[i] += static_cast<Scalar>(2.0 * weight * scaled);
    }
  }
  return value;
}

HandleError handle_error(const BoundHandles& handles, PointsIn values) {
  require(values.rows() == handles.sources().rows(), "values", std::to_string(values.rows()) + " rows",
          std::to_string(handles.sources().rows()) + " are needed");
  HandleError error;
  for (Index i = 0; i < handles.count(); ++i) {
    const Index rows = handles.begin(i + 1) - handles.begin(i);
    const Vector distance =
        (values.middleRows(handles.begin(i), rows) - handles.targets().middleRows(handles.begin(i), rows))
            .rowwise()
            .norm();
    error.mean += distance.mean() / static_cast<double>(handles.count());
    error.max = std::max(error.max, distance.maxCoeff());
  }
  return error;
}

#define ARAPFIELDS_HANDLES(Scalar)                                                                 \
  template HandleBatch<Scalar> BoundHandles::batch<Scalar>(Index, Random&) const;                  \
  template HandleBatch<Scalar> BoundHandles::all<Scalar>() const;                                  \
  template double handle_energy<Scalar>(JetView<const Scalar>, const HandleBatch<Scalar>&, double, \
                                        JetView<Scalar>);
ARAPFIELDS_HANDLES(float)
ARAPFIELDS_HANDLES(double)

}  // namespace arapfields
