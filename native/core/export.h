// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

/// Marks the symbols that libarapfields exports; all others are hidden. A class that is thrown, or has
/// virtual functions, is exported entirely, so that it is one type on both sides of the library's boundary.
/// On Windows the library's own sources (ARAPFIELDS_BUILDING) export what those of others import.
/// ARAPFIELDS_ONE_MODULE: the library lies inside the bindings' module, and has no boundary.
#if defined(ARAPFIELDS_ONE_MODULE)
#define ARAPFIELDS_EXPORT
#elif !defined(_WIN32)
#define ARAPFIELDS_EXPORT __attribute__((visibility("default")))
#elif defined(ARAPFIELDS_BUILDING)
#define ARAPFIELDS_EXPORT __declspec(dllexport)
#else
#define ARAPFIELDS_EXPORT __declspec(dllimport)
#endif

/// Marks what is exported for our own tests, through the bindings' module `testing`; not installed.
#define ARAPFIELDS_EXPORT_TO_TESTS ARAPFIELDS_EXPORT
