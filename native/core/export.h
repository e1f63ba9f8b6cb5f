// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

/// Marks what libarapfields offers: all else stays inside. A class that is thrown, or has virtual functions,
/// is marked as a whole, so that both sides of the library's border know it as one type. On Windows the
/// library's own sources (ARAPFIELDS_BUILDING) export what those of others import.
#if !defined(_WIN32)
#define ARAPFIELDS_EXPORT __attribute__((visibility("default")))
#elif defined(ARAPFIELDS_BUILDING)
#define ARAPFIELDS_EXPORT __declspec(dllexport)
#else
#define ARAPFIELDS_EXPORT __declspec(dllimport)
#endif

/// Marks what is offered to our own tests alone, through the bindings' module `testing`; not installed.
#define ARAPFIELDS_EXPORT_TO_TESTS ARAPFIELDS_EXPORT
