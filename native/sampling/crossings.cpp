// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/crossings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "core/errors.h"
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

namespace {

// Curvature of Φ − p along a line, over the model's slope error per spacing. On four published networks 90 %
// of the points are below half of this; the 99 % point is 0.5 to 1.4 times it.
constexpr double curvature_factor = 5.0;
constexpr int nodes = 5;             // parameters of a piece at which p is evaluated, both ends included
constexpr double zero_piece = 0.01;  // pieces with Φ = 0 at both ends are not split below this length
constexpr std::size_t most_pieces_a_line = 512, fewest_pieces = 4096;
constexpr double most_pieces = 1 << 25;  // bound of the pieces in memory

/// A piece of a line with Φ known at both ends.
struct Piece {
  Index line;
  double low, high;
  double low_value, high_value;
  double split = 0.0;  // parameter of the next evaluation
};

enum class Roots { none, zero, one, unknown };

/// The number of zeros of Φ in the piece, as far as the bounds by p and by Φ at both ends decide it. Sets
/// `split` and, for one zero, the bracket's guess and slope.
Roots classify_interval(const TricubicSurrogate& model, const Line& line, Piece& piece, double finest,
                        Bracket& bracket) {
  const double length = piece.high - piece.low, fa = piece.low_value, fb = piece.high_value;
  const bool passes = (fa < 0.0) != (fb < 0.0);
  if (!passes && std::abs(fa) + std::abs(fb) > model.lipschitz() * length) return Roots::none;
  const double chord = fa == fb ? 0.5 : fa / (fa - fb);
  if (fa == 0.0 && fb == 0.0 && length <= zero_piece) return Roots::zero;
  bracket = {piece.line, piece.low, piece.high, piece.low + std::clamp(chord, 0.0, 1.0) * length,
             (fb - fa) / length};
  if (length <= finest) return passes ? Roots::one : Roots::none;

  // q = p + the residual Φ − p interpolated between the ends.
  std::array<double, nodes> q{};
  double slope_error = 0.0;
  bool known = true;
  for (int i = 0; i < nodes && known; ++i) {
    const Vec3 x = line.at(piece.low + length * i / (nodes - 1));
    const Index cell = model.cell(model.position(x[0]), model.position(x[1]), model.position(x[2]));
    known = model.side(cell) == 0;
    if (!known) break;
    q[i] = model(x);
    slope_error = std::max<double>(slope_error, model.slope_error(cell));
  }
  piece.split = 0.5 * (piece.low + piece.high);
  if (!known) return Roots::unknown;
  const double ra = fa - q.front(), rb = fb - q.back();
  for (int i = 0; i < nodes; ++i) {
    const double w = static_cast<double>(i) / (nodes - 1);
    q[i] += (1.0 - w) * ra + w * rb;
  }
  const double step = length / (nodes - 1);
  double least = std::abs(q[0]), bend = 0.0, shallowest = std::abs(q[1] - q[0]) / step;
  bool same_sign = true, monotone = true;
  int nearest = 1, pass = -1;
  for (std::size_t i = 0; i + 1 < nodes; ++i) {
    least = std::min(least, std::abs(q[i + 1]));
    shallowest = std::min(shallowest, std::abs(q[i + 1] - q[i]) / step);
    same_sign = same_sign && (q[i] < 0.0) == (q[i + 1] < 0.0);
    monotone = monotone && (q[i + 1] > q[i]) == (q[1] > q[0]);
    if ((q[i] < 0.0) != (q[i + 1] < 0.0)) pass = static_cast<int>(i);
    if (i > 0) bend = std::max(bend, std::abs(q[i + 1] - 2.0 * q[i] + q[i - 1]) / step);
    if (i > 0 && std::abs(q[i]) < std::abs(q[nearest])) nearest = static_cast<int>(i);
  }
  // Bounds of the deviation of the residual and its slope from their chord: by its slope, or its curvature.
  const double bow = curvature_factor * length / model.spacing();
  const double deviation = slope_error * length * std::min(0.5, 0.125 * bow);
  const double slope_deviation = slope_error * std::min(2.0, 0.5 * bow);
  if (same_sign && !passes && least - 0.25 * bend * step > deviation) return Roots::none;
  if (pass >= 0) {
    const double a = q[pass], b = q[pass + 1];
    const double root = piece.low + step * (pass + (a == b ? 0.5 : a / (a - b)));
    if (passes) {
      bracket.guess = std::clamp(root, piece.low, piece.high);
      bracket.slope = (b - a) / step;
      const bool agrees = (bracket.slope > 0.0) == (fb > fa);
      if (monotone && agrees && shallowest - bend > slope_deviation) return Roots::one;
    }
    piece.split = std::clamp(root, piece.low + 0.1 * length, piece.high - 0.1 * length);
  } else {
    piece.split = piece.low + step * nearest;
  }
  return Roots::unknown;
}

VectorF evaluate_at(EvaluationCounter& function, const std::vector<Line>& lines,
                    const std::vector<Piece>& pieces, double Piece::* parameter) {
  PointsF points(static_cast<Index>(pieces.size()), 3);
  for (Index row = 0; row < points.rows(); ++row) {
    const Piece& piece = pieces[row];
    points.row(row) = lines[piece.line].at(piece.*parameter).cast<float>();
  }
  return function.values(points);
}

/// Resolves some of the intervals, as many as fit in memory.
void resolve(EvaluationCounter& function, const TricubicSurrogate& model, const std::vector<Line>& lines,
             std::span<const AmbiguousInterval> ambiguous, double finest, double& zero_length,
             std::vector<Bracket>& found) {
  std::vector<Piece> pieces;
  for (const AmbiguousInterval& interval : ambiguous)
    pieces.push_back({interval.line, interval.low, interval.high, 0.0, 0.0});
  const VectorF low = evaluate_at(function, lines, pieces, &Piece::low);
  const VectorF high = evaluate_at(function, lines, pieces, &Piece::high);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    pieces[i].low_value = low[i];
    pieces[i].high_value = high[i];
  }
  const auto touched = static_cast<std::size_t>(ambiguous.back().line - ambiguous.front().line + 1);
  while (!pieces.empty()) {
    require(pieces.size() <= std::max(fewest_pieces, most_pieces_a_line * touched), "sdf",
            std::string("its values vary like noise, or stay within rounding of 0: over ")
                .append(std::to_string(most_pieces_a_line))
                .append(" places on each line may be zeros"),
            "a function with a zero surface inside the cube [-1, 1]^3 is needed");
    const auto count = static_cast<Index>(pieces.size());
    std::vector<Roots> roots(pieces.size());
    std::vector<Bracket> brackets(pieces.size());
    parallel_for(0, count, 64, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i)
        roots[i] = classify_interval(model, lines[pieces[i].line], pieces[i], finest, brackets[i]);
    });
    std::vector<Piece> open;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (roots[i] == Roots::zero) zero_length += pieces[i].high - pieces[i].low;
      if (roots[i] == Roots::one) found.push_back(brackets[i]);
      if (roots[i] == Roots::unknown) open.push_back(pieces[i]);
    }
    const VectorF values = evaluate_at(function, lines, open, &Piece::split);
    pieces.clear();
    for (std::size_t i = 0; i < open.size(); ++i) {
      const Piece& p = open[i];
      const double value = values[i];
      pieces.push_back({p.line, p.low, p.split, p.low_value, value});
      pieces.push_back({p.line, p.split, p.high, value, p.high_value});
    }
  }
}

}  // namespace

std::vector<Bracket> resolve_ambiguous(EvaluationCounter& function, const TricubicSurrogate& model,
                                       const std::vector<Line>& lines,
                                       const std::vector<AmbiguousInterval>& ambiguous, double finest,
                                       double* zero_length) {
  std::vector<Bracket> found;
  double zeros = 0.0, pieces = 0.0;
  for (std::size_t begin = 0, end = 0; end < ambiguous.size();) {
    pieces += (ambiguous[end].high - ambiguous[end].low) / finest;
    if (++end < ambiguous.size() && pieces < most_pieces) continue;
    resolve(function, model, lines, {ambiguous.data() + begin, end - begin}, finest, zeros, found);
    begin = end, pieces = 0.0;
  }
  if (zero_length != nullptr) *zero_length += zeros;
  std::sort(found.begin(), found.end(), [](const Bracket& a, const Bracket& b) {
    return a.line != b.line ? a.line < b.line : a.low < b.low;
  });
  return found;
}

namespace {

constexpr int max_rounds = 40;
constexpr int max_gradients = 3;  // gradients for each zero, if rounding keeps |Φ| above the tolerance
constexpr double acceptable_value = 1e-4;
// A secant step from here is expected to end below the tolerance: the next evaluation takes the gradient.
constexpr double near_tolerance = 3e-4;
constexpr double narrowest_bracket = 1e-8;

/// The state of the root search in one bracket.
struct RootSearch {
  Index bracket = 0;
  int low_sign = 0;              // of Φ at low
  double low = 0.0, high = 0.0;  // around the zero
  double t = 0.0;                // where Φ is evaluated next …
  double slope = 0.0;            // … and its slope as far as known
  double old_t = 0.0, old_value = 0.0;
  double old_width = 0.0;
  int rounds = 0, gradients_taken = 0;
  bool wants_gradient = false;  // the next evaluation takes the gradient
  bool done = false;

  /// Updates the bracket with Φ(t) and its slope, and chooses the next parameter.
  void step_to_next(double value, double new_slope) {
    slope = new_slope;
    ((value < 0.0 ? -1 : 1) == low_sign ? low : high) = t;
    old_t = t;
    old_value = value;
    bool stalled = false;
    if (++rounds % 4 == 0) {
      stalled = high - low > 0.25 * old_width;
      old_width = high - low;
    }
    wants_gradient = std::abs(value) < near_tolerance;
    t -= value / slope;
    if (!(t > low && t < high) || stalled) t = 0.5 * (low + high);
  }
  void update_with_value(double value, double tolerance) {
    const double at = t;
    const bool secant = rounds > 0 && std::abs(t - old_t) > 1e-6;
    step_to_next(value, secant ? (value - old_value) / (t - old_t) : slope);
    if (rounds == 1) wants_gradient = false;  // its slope is the model's
    if (std::abs(value) > tolerance && high - low > narrowest_bracket) return;
    t = at;
    wants_gradient = true;
  }
  void update_with_gradient(double value, double new_slope, double tolerance) {
    done = std::abs(value) <= tolerance || high - low < narrowest_bracket ||
           (++gradients_taken == max_gradients && std::abs(value) <= acceptable_value);
    if (!done) step_to_next(value, new_slope != 0.0 ? new_slope : slope);
  }
};

}  // namespace

Crossings find_crossings(EvaluationCounter& function, const std::vector<Line>& lines,
                         const std::vector<Bracket>& brackets, double tolerance) {
  const auto total = static_cast<Index>(brackets.size());
  PointsF points(total, 3), gradients(total, 3);
  std::vector<double> best(brackets.size(), 1e30);
  std::vector<RootSearch> active(brackets.size());
  for (std::size_t i = 0; i < brackets.size(); ++i) {
    const Bracket& b = brackets[i];
    active[i] = {.bracket = static_cast<Index>(i),
                 .low_sign = b.slope > 0.0 ? -1 : 1,
                 .low = b.low,
                 .high = b.high,
                 .t = b.guess,
                 .slope = b.slope,
                 .old_width = b.high - b.low};
  }
  const auto line_of = [&](const RootSearch& s) -> const Line& { return lines[brackets[s.bracket].line]; };
  for (int round = 0; round < max_rounds && !active.empty(); ++round) {
    const auto plain_end = std::stable_partition(active.begin(), active.end(),
                                                 [](const RootSearch& s) { return !s.wants_gradient; });
    const auto plain = static_cast<Index>(plain_end - active.begin());
    PointsF batch(static_cast<Index>(active.size()), 3), slopes;
    for (Index row = 0; row < batch.rows(); ++row) {
      const RootSearch& s = active[row];
      batch.row(row) = line_of(s).at(s.t).cast<float>();
    }
    const VectorF values = function.values(batch.topRows(plain));
    const VectorF ends = function.values(batch.bottomRows(batch.rows() - plain), slopes);
    for (Index row = 0; row < batch.rows(); ++row) {
      RootSearch& s = active[row];
      if (row < plain) {
        s.update_with_value(values[row], tolerance);
        continue;
      }
      const double value = ends[row - plain];
      double& least = best[s.bracket];
      if (std::abs(value) < least) {
        least = std::abs(value);
        points.row(s.bracket) = batch.row(row);
        gradients.row(s.bracket) = slopes.row(row - plain);
      }
      s.update_with_gradient(value, slopes.row(row - plain).cast<double>().dot(line_of(s).direction),
                             tolerance);
    }
    std::erase_if(active, [](const RootSearch& s) { return s.done; });
  }
  Crossings result;
  for (Index i = 0; i < total; ++i) {
    const double value = best[i];
    (value <= acceptable_value ? result.bracket : result.failed).push_back(i);
    if (value <= acceptable_value) result.largest = std::max(result.largest, value);
  }
  result.points.resize(result.bracket.size(), 3);
  result.gradients.resize(result.points.rows(), 3);
  for (Index row = 0; row < result.points.rows(); ++row) {
    result.points.row(row) = points.row(result.bracket[row]);
    result.gradients.row(row) = gradients.row(result.bracket[row]);
  }
  return result;
}

}  // namespace arapfields
