// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/piece_points.h"

#include <algorithm>
#include <map>

#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"

namespace arapfields {

Index PiecePoints::count() const { return pieces.empty() ? 0 : 1 + *std::ranges::max_element(pieces); }

std::vector<Index> nearest_on_own(const PiecePoints& points, const PiecePoints& others, double turn,
                                  Index enough) {
  std::vector<Index> result =
      OrientedPoints(others.points, others.normals).nearest(points.points, points.normals, turn);
  std::map<Index, std::vector<Index>> own, missed;
  for (std::size_t j = 0; j < others.pieces.size(); ++j)
    own[others.pieces[j]].push_back(static_cast<Index>(j));
  for (std::size_t i = 0; i < result.size(); ++i)
    if (points.pieces[i] != others.pieces[result[i]])
      missed[points.pieces[i]].push_back(static_cast<Index>(i));
  for (const auto& [piece, rows] : missed) {
    const std::vector<Index>& candidates = own[piece];
    if (static_cast<Index>(candidates.size()) < std::max<Index>(enough, 1)) continue;
    const std::vector<Index> near =
        OrientedPoints(rows_of(others.points, candidates), rows_of(others.normals, candidates))
            .nearest(rows_of(points.points, rows), rows_of(points.normals, rows), turn);
    for (std::size_t k = 0; k < rows.size(); ++k) result[rows[k]] = candidates[near[k]];
  }
  return result;
}

}  // namespace arapfields
