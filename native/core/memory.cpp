// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/memory.h"

#ifdef _WIN32
#include <windows.h>
#else
#include <sys/resource.h>
#include <unistd.h>
#ifdef __APPLE__
#include <mach/mach.h>
#endif
#endif

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>

#include "core/errors.h"

namespace arapfields {
namespace {

constexpr double gib = 1024.0 * 1024.0 * 1024.0;

#ifdef _WIN32

MEMORYSTATUSEX status() {
  MEMORYSTATUSEX result{};
  result.dwLength = sizeof result;
  if (GlobalMemoryStatusEx(&result) == 0)
    result.ullAvailPhys = result.ullAvailPageFile = result.ullAvailVirtual = ~0ull;
  return result;
}

double system_memory() { return static_cast<double>(status().ullAvailPhys); }

/// What the page file, or the job that the process belongs to, still backs.
double group_memory() { return static_cast<double>(status().ullAvailPageFile); }

/// What the process's addresses leave.
double process_memory() { return static_cast<double>(status().ullAvailVirtual); }

#else

constexpr double unknown = std::numeric_limits<double>::infinity();

/// The one number in a file; infinity where there is none ("max" included).
double number_in(const char* path) {
  std::ifstream file(path);
  double value = 0.0;
  return file >> value ? value : unknown;
}

#ifdef __APPLE__

/// What is free or can be had at once from files and caches.
double system_memory() {
  vm_statistics64_data_t pages{};
  mach_msg_type_number_t count = HOST_VM_INFO64_COUNT;
  const mach_port_t host = mach_host_self();
  const bool known = host_statistics64(host, HOST_VM_INFO64, reinterpret_cast<host_info64_t>(&pages),
                                       &count) == KERN_SUCCESS;
  mach_port_deallocate(mach_task_self(), host);
  if (!known) return unknown;
  const double available =
      static_cast<double>(pages.free_count) + pages.inactive_count + pages.purgeable_count;
  return available * static_cast<double>(sysconf(_SC_PAGESIZE));
}

#else

double system_memory() {
  std::ifstream file("/proc/meminfo");
  for (std::string name, rest; file >> name && name != "MemAvailable:";) std::getline(file, rest);
  double kilobytes = 0.0;
  return file >> kilobytes ? kilobytes * 1024.0 : unknown;
}

#endif

double group_memory() {
  const double limit = number_in("/sys/fs/cgroup/memory.max"),
               used = number_in("/sys/fs/cgroup/memory.current");
  return limit < unknown && used < unknown ? std::max(0.0, limit - used) : unknown;
}

/// What the process's own limit (ulimit -v) leaves.
double process_memory() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unknown;
  const double used = number_in("/proc/self/statm") * static_cast<double>(sysconf(_SC_PAGESIZE));
  return used < unknown ? std::max(0.0, static_cast<double>(limit.rlim_cur) - used) : unknown;
}

#endif

std::string in_gib(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GiB", bytes / gib);
  return text;
}

}  // namespace

double available_memory() { return std::min({system_memory(), group_memory(), process_memory()}); }

void require_memory(const std::string& argument, double bytes) {
  if (bytes < gib / 4) return;  // not worth a look
  const double available = available_memory();
  require(bytes <= available, argument, "this would take about " + in_gib(bytes) + " of memory",
          in_gib(available) + " are free: use less");
}

}  // namespace arapfields
