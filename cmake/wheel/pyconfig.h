/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What CPython's configure found out, as far as the public headers ask (tests/packaging): by the compiler's
 * own words, for every system that wheels are built for. */
#ifndef Py_PYCONFIG_H
#define Py_PYCONFIG_H
#define SIZEOF_INT __SIZEOF_INT__
#define SIZEOF_LONG __SIZEOF_LONG__
#define SIZEOF_LONG_DOUBLE __SIZEOF_LONG_DOUBLE__
#define SIZEOF_LONG_LONG __SIZEOF_LONG_LONG__
#define SIZEOF_SIZE_T __SIZEOF_SIZE_T__
#define SIZEOF_UINTPTR_T __SIZEOF_POINTER__
#define SIZEOF_VOID_P __SIZEOF_POINTER__
#define SIZEOF_WCHAR_T __SIZEOF_WCHAR_T__
#define SIZEOF__BOOL 1
#define SIZEOF_PID_T 4
#define SIZEOF_TIME_T 8
#define HAVE_CLOCK_GETTIME 1
#define HAVE_SSIZE_T 1
#define HAVE_SYS_STAT_H 1
#define HAVE_SYS_TIME_H 1
#define HAVE_SYS_TYPES_H 1
#define HAVE_WCHAR_H 1
#define PY_FORMAT_SIZE_T "z"
#define WITH_DOC_STRINGS 1
#define WITH_MIMALLOC 1
#define WITH_PYMALLOC 1
#define _Py_STACK_GROWS_DOWN 1
#if (defined(__APPLE__) || defined(_WIN32)) && defined(__aarch64__)
#define ALIGNOF_MAX_ALIGN_T 8
#else
#define ALIGNOF_MAX_ALIGN_T 16
#endif
#ifdef _WIN32
#define HAVE_DECLSPEC_DLL 1
#define MS_WIN32 1
#define MS_WIN64 1
#define MS_WINDOWS 1
#define NT_THREADS 1
#define Py_ENABLE_SHARED 1
#else
#define HAVE_FORK 1
#define HAVE_PTHREAD_H 1
#define HAVE_SYS_SELECT_H 1
#define SIZEOF_PTHREAD_T 8
#ifdef __APPLE__
#define _DARWIN_C_SOURCE 1
#endif
#include <pthread.h>
#include <sys/types.h>
static_assert(sizeof(pthread_t) == SIZEOF_PTHREAD_T && sizeof(pid_t) == SIZEOF_PID_T, "of configure");
#endif
#include <cstddef>
#include <ctime>
static_assert(alignof(std::max_align_t) == ALIGNOF_MAX_ALIGN_T && sizeof(time_t) == SIZEOF_TIME_T,
              "of configure");
#endif
