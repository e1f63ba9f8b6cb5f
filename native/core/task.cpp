// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/task.h"

#include <algorithm>

#include "core/errors.h"

namespace arapfields {

std::string Task::message() const {
  std::lock_guard lock(mutex_);
  return message_;
}

void Task::report(double fraction, const std::string& message) {
  double seen = progress_.load(std::memory_order_relaxed);
  const double wanted = std::clamp(fraction, 0.0, 1.0);
  while (wanted > seen && !progress_.compare_exchange_weak(seen, wanted)) {
  }
  if (message.empty()) return;
  std::lock_guard lock(mutex_);
  message_ = message;
}

Progress Progress::part(double from, double to) const {
  const double length = end_ - begin_;
  return Progress(task_, begin_ + from * length, begin_ + to * length);
}

void Progress::report(double fraction, const std::string& message) const {
  if (task_ == nullptr) return;
  task_->report(begin_ + (end_ - begin_) * std::clamp(fraction, 0.0, 1.0), message);
  check();
}

void Progress::check() const {
  if (cancelled()) throw Cancelled();
}

}  // namespace arapfields
