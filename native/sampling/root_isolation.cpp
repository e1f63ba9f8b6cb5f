// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/root_isolation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr double step_in_spacings = 0.35;
constexpr double sliver_in_spacings = 1e-4;
constexpr Index lines_per_chunk = 256;

enum class Kind { clear, rising, falling, open };

/// p at ascending parameters of a stretch of active cells; errors[i] belongs to the step from i to i + 1.
struct Run {
  std::vector<double> t, p, error, slope_error;
  void clear() {
    t.clear();
    p.clear();
    error.clear();
    slope_error.clear();
  }
};

int sign_of(double x) { return x < 0.0 ? -1 : 1; }

/// Walks a line through the grid's cells (Amanatides, Woo 1987).
class CellWalk {
 public:
  CellWalk(const TricubicSurrogate& model, const Line& line) : line_(line), cells_(model.cells_a_side()) {
    const double h = model.spacing();
    const Vec3 start = line.at(std::min(1e-9, line.length));
    for (int axis = 0; axis < 3; ++axis) {
      const double d = line.direction[axis];
      place[axis] = model.position(start[axis]);
      step_[axis] = d > 0.0 ? 1 : -1;
      advance_[axis] = d == 0.0 ? std::numeric_limits<double>::infinity() : h / std::abs(d);
      const double wall = (place[axis] + (d > 0.0 ? 1 : 0)) * h - 1.0;
      next_[axis] = d == 0.0 ? std::numeric_limits<double>::infinity() : (wall - line.origin[axis]) / d;
    }
    set_leave();
  }
  /// False beyond the line's end, which rounding may place slightly outside of the grid.
  bool next() {
    enter = leave;
    if (enter >= line_.length) return false;
    place[axis_] += step_[axis_];
    if (place[axis_] < 0 || place[axis_] >= cells_) return false;
    next_[axis_] += advance_[axis_];
    set_leave();
    return true;
  }

  int place[3];
  double enter = 0.0, leave = 0.0;

 private:
  void set_leave() {
    axis_ = next_[0] <= next_[1] ? (next_[0] <= next_[2] ? 0 : 2) : (next_[1] <= next_[2] ? 1 : 2);
    leave = std::clamp(next_[axis_], enter, line_.length);
  }
  const Line& line_;
  int cells_, step_[3], axis_ = 0;
  double advance_[3], next_[3];
};

/// Appends p on [from, to], which lies in the cell, to the run.
void append(const TricubicSurrogate& model, const Line& line, const CellWalk& walk, Index cell, double from,
            double to, Run& run) {
  const CubicBlock block = model.block(cell);
  const double inverse = 1.0 / model.spacing();
  Vec3 origin, rate;  // in the block's coordinates
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = (line.origin[axis] + 1.0) * inverse - model.block_start(walk.place[axis]);
    rate[axis] = line.direction[axis] * inverse;
  }
  const auto value = [&](double t) -> double {
    const Vec3 u = origin + t * rate;
    return block(static_cast<float>(u[0]), static_cast<float>(u[1]), static_cast<float>(u[2]));
  };
  if (run.t.empty()) {
    run.t.push_back(from);
    run.p.push_back(value(from));
  }
  const int steps = std::max(1, static_cast<int>(std::ceil((to - from) * inverse / step_in_spacings)));
  for (int i = 1; i <= steps; ++i) {
    const double t = i == steps ? to : from + (to - from) * i / steps;
    run.t.push_back(t);
    run.p.push_back(value(t));
    run.error.push_back(model.error(cell));
    run.slope_error.push_back(model.slope_error(cell));
  }
}

/// Classifies a run's steps: without a zero, brackets, or ambiguous. `before` and `after` are Φ's sign at the
/// run's ends, or 0 where the line starts or ends there.
void classify(const Run& run, Index line, int before, int after, ScanResult& out, std::vector<Kind>& kinds) {
  const std::size_t steps = run.error.size();
  const auto slope = [&](std::size_t i) { return (run.p[i + 1] - run.p[i]) / (run.t[i + 1] - run.t[i]); };
  kinds.resize(steps);
  for (std::size_t i = 0; i < steps; ++i) {
    const double own = slope(i);
    double bend = 0.0;  // estimated variation of the slope within the step
    if (i > 0) bend = std::abs(own - slope(i - 1));
    if (i + 1 < steps) bend = std::max(bend, std::abs(slope(i + 1) - own));
    const double a = run.p[i], b = run.p[i + 1];
    const double least = std::min(std::abs(a), std::abs(b)) - 0.25 * bend * (run.t[i + 1] - run.t[i]);
    kinds[i] = a * b > 0.0 && least > run.error[i] ? Kind::clear
               : own - bend > run.slope_error[i]   ? Kind::rising
               : -own - bend > run.slope_error[i]  ? Kind::falling
                                                   : Kind::open;
  }
  const auto certain = [&](std::size_t node, double error) {
    return std::abs(run.p[node]) > error ? sign_of(run.p[node]) : 0;
  };
  for (std::size_t i = 0; i < steps;) {
    if (kinds[i] == Kind::clear) {
      ++i;
      continue;
    }
    std::size_t end = i;
    bool monotone = kinds[i] != Kind::open;
    for (; end < steps && kinds[end] != Kind::clear; ++end) monotone = monotone && kinds[end] == kinds[i];
    const int left = i > 0 ? sign_of(run.p[i]) : before != 0 ? before : certain(i, run.error[i]);
    const int right = end < steps  ? sign_of(run.p[end])
                      : after != 0 ? after
                                   : certain(end, run.error[end - 1]);
    const int direction = kinds[i] == Kind::rising ? 1 : -1;
    if (monotone && left == -direction && right == direction) {
      std::size_t at = i;  // the step in which p changes its sign, else the one nearest to zero
      for (std::size_t s = i; s < end; ++s) {
        if (std::abs(run.p[s]) + std::abs(run.p[s + 1]) < std::abs(run.p[at]) + std::abs(run.p[at + 1]))
          at = s;
        if (run.p[s] * run.p[s + 1] <= 0.0) {
          at = s;
          break;
        }
      }
      const double guess = run.t[at] - run.p[at] / slope(at);
      out.brackets.push_back(
          {line, run.t[i], run.t[end], std::clamp(guess, run.t[i], run.t[end]), slope(at)});
    } else if (!(monotone && left != 0 && left == right)) {
      out.ambiguous.push_back({line, run.t[i], run.t[end]});
    }
    i = end;
  }
}

void scan(const TricubicSurrogate& model, const Line& line, Index index, Run& run, std::vector<Kind>& kinds,
          ScanResult& out) {
  const double sliver = sliver_in_spacings * model.spacing();
  int before = 0;
  double start = 0.0;  // parameter up to which the line is scanned
  run.clear();
  const auto finish = [&](int after) {
    if (!run.error.empty()) classify(run, index, before, after, out, kinds);
    run.clear();
  };
  CellWalk walk(model, line);
  do {
    const Index cell = model.cell(walk.place[0], walk.place[1], walk.place[2]);
    const int side = model.side(cell);
    if (side != 0) {
      finish(side);
      before = side;
      start = walk.leave;
    } else if (walk.leave - start > sliver) {
      append(model, line, walk, cell, start, walk.leave, run);
      start = walk.leave;
    }
  } while (walk.next());
  finish(0);
}

}  // namespace

ScanResult scan_lines(const TricubicSurrogate& model, const std::vector<Line>& lines) {
  const auto count = static_cast<Index>(lines.size());
  const Index chunks = (count + lines_per_chunk - 1) / lines_per_chunk;
  std::vector<ScanResult> parts(chunks);
  parallel_for(0, chunks, 1, [&](Index begin, Index end) {
    Run run;
    std::vector<Kind> kinds;
    for (Index chunk = begin; chunk < end; ++chunk)
      for (Index i = chunk * lines_per_chunk; i < std::min(count, (chunk + 1) * lines_per_chunk); ++i)
        scan(model, lines[i], i, run, kinds, parts[chunk]);
  });
  ScanResult result;
  for (const ScanResult& part : parts) {
    result.brackets.insert(result.brackets.end(), part.brackets.begin(), part.brackets.end());
    result.ambiguous.insert(result.ambiguous.end(), part.ambiguous.begin(), part.ambiguous.end());
  }
  return result;
}

}  // namespace arapfields
