// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "solve/contact/surface.h"

namespace arapfields {

/// How far nodes of a surface may go in contact: each stays as far from the ground and each obstacle as its
/// margin says, or where it is nearer or inside at the start, not nearer than there; and on its side of a
/// sheet.
class ContactLimits {
 public:
  /// `start` (k,3), which must outlive it.
  ContactLimits(const Contact& contact, const Points& start, const Progress& progress);
  bool any() const { return !sides_.empty(); }

  /// Moves nodes back that are beyond; (k) 1 for these. From one thread at a time.
  std::vector<char> keep(Points& positions) const;

 private:
  struct Side {
    ContactSurface surface;
    Vector least;  // (k) distances, in the frame
    Vector room;   // (k) how far a node may go in any direction
  };
  bool keep(const Side& side, int round, Points& positions, std::vector<char>& kept) const;

  const Points& start_;
  Frame frame_;
  std::vector<Side> sides_;
};

}  // namespace arapfields
