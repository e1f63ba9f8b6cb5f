// SPDX-License-Identifier: GPL-3.0-or-later
// Quantities that follow from others, as geometry-central's DependentQuantity
// (surface/base_geometry_interface).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>

namespace arapfields {

/// Counts the changes of something that other quantities follow from.
using Revision = std::uint64_t;

/// A value that is made when it is needed, and made anew after a change of what it follows from.
template <class Value, std::size_t count>
class Dependent {
 public:
  using Revisions = std::array<Revision, count>;

  /// The value of these revisions: what is held, or else what `make` returns.
  template <class Make>
  Value& get(const Revisions& revisions, Make&& make) {
    if (revisions_ != revisions) set(revisions, make());
    return value_;
  }
  /// The value that was made last, of whatever revisions.
  const Value& latest() const { return value_; }
  void set(const Revisions& revisions, Value value) {
    value_ = std::move(value);
    revisions_ = revisions;
  }
  /// Moves the value out; an empty one where none of these revisions is held.
  Value take(const Revisions& revisions) {
    const bool is_current = std::exchange(revisions_, std::nullopt) == revisions;
    return is_current ? std::exchange(value_, Value()) : Value();
  }

 private:
  std::optional<Revisions> revisions_;
  Value value_{};
};

}  // namespace arapfields
