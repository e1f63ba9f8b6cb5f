// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

/// Marks what libarapfields offers: all else is compiled with hidden visibility. A class that is thrown, or
/// has virtual functions, is marked as a whole, so that both sides of the library's border know it as one
/// type.
#define ARAPFIELDS_EXPORT __attribute__((visibility("default")))

/// Marks what is offered to our own tests alone, through the bindings' module `testing`; not installed.
#define ARAPFIELDS_EXPORT_TO_TESTS __attribute__((visibility("default")))
