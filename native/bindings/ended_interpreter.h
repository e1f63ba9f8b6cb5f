// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace arapfields::python {

/// Has NumPy's functions, where they ask for the lock of an interpreter that has ended, stop their thread as
/// this module's other calls of Python do; on Linux.
#if defined(__linux__)
void stop_in_numpy();
#else
inline void stop_in_numpy() {}
#endif

}  // namespace arapfields::python
