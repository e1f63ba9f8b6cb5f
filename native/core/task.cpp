// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/task.h"

#include <algorithm>

#include "core/errors.h"

namespace arapfields {
namespace {

std::chrono::steady_clock::duration seconds(double count) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(count));
}

}  // namespace

std::string Task::message() const {
  std::lock_guard lock(mutex_);
  return message_;
}

void Task::report(double fraction, const std::string& message) {
  double seen = progress_.load(std::memory_order_relaxed);
  const double reached = std::clamp(fraction, 0.0, 1.0);
  while (reached > seen && !progress_.compare_exchange_weak(seen, reached)) {
  }
  if (message.empty()) return;
  std::lock_guard lock(mutex_);
  message_ = message;
}

void Task::watch(PointsIn points, double pause) {
  require(points.allFinite(), "points", "some are NaN or infinite", "all must be finite");
  require(pause >= 0.0, "seconds", std::to_string(pause), "must not be negative");
  std::lock_guard lock(mutex_);
  watched_points_ = points;
  pause_ = pause;
  next_preview_ = Clock::now();
}

Index Task::previews() const {
  std::lock_guard lock(mutex_);
  return previews_;
}

PointsF Task::watched() const {
  std::lock_guard lock(mutex_);
  return preview_;
}

Progress Progress::part(double from, double to) const {
  const double length = end_ - begin_;
  return Progress(task_, begin_ + from * length, begin_ + to * length, interruption_);
}

void Progress::report(double fraction, const std::string& message) const {
  if (task_ == nullptr) return;
  task_->report(begin_ + (end_ - begin_) * std::clamp(fraction, 0.0, 1.0), message);
  check();
}

bool Progress::cancelled() const {
  if (task_ == nullptr) return false;
  if (interruption_ != nullptr && (*interruption_)()) task_->cancel();
  return task_->cancelled();
}

void Progress::check() const {
  if (cancelled()) throw Cancelled();
}

void Progress::preview(const std::function<Points(PointsIn)>& evaluate) const {
  constexpr int work_over_preview = 2;
  if (task_ == nullptr) return;
  const auto begin = Task::Clock::now();
  Points points;
  {
    std::lock_guard lock(task_->mutex_);
    if (task_->watched_points_.rows() == 0 || begin < task_->next_preview_) return;
    points = task_->watched_points_;
  }
  PointsF positions = evaluate(points).cast<float>();
  const auto took = Task::Clock::now() - begin;
  std::lock_guard lock(task_->mutex_);
  const auto pause = std::max<Task::Clock::duration>(seconds(task_->pause_), work_over_preview * took + took);
  task_->next_preview_ = begin + pause;
  task_->preview_ = std::move(positions);
  ++task_->previews_;
}

}  // namespace arapfields
