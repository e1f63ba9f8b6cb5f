# SPDX-License-Identifier: GPL-3.0-or-later
"""Stub libraries to link against instead of the system's, for binaries that run with an older glibc.

The system's compiler links against stubs: glibc of the wanted version, by ziglang's lists of symbols, and
libstdc++ without symbols that are newer than the manylinux tag allows. Missing symbols of libstdc++ are taken
from its static archive, as in the manylinux containers.
"""

import os
import re
from pathlib import Path

from platforms import run, zig

NEWEST = {"GLIBCXX_3.4": 25, "CXXABI_1.3": 11}  # the newest versions that manylinux_2_28 allows, of GCC 8
GLIBC = ["libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "librt.so.1"]
# Functions that headers of newer glibc use and older libraries lack: processes count as multi-threaded, stat
# and the like have their older names, and timed locks use the real-time clock.
COMPATIBLE = """
#define _GNU_SOURCE
#include <pthread.h>
#include <sys/stat.h>
#include <time.h>
#define HIDDEN __attribute__((visibility("hidden")))
#ifdef __x86_64__
#define KERNELS 1
#else
#define KERNELS 0
#endif
HIDDEN char __libc_single_threaded = 0;
int __fxstat(int version, int file, struct stat *to);
HIDDEN int fstat(int file, struct stat *to) { return __fxstat(KERNELS, file, to); }
int __xstat(int version, const char *path, struct stat *to);
HIDDEN int stat(const char *path, struct stat *to) { return __xstat(KERNELS, path, to); }
int __lxstat(int version, const char *path, struct stat *to);
HIDDEN int lstat(const char *path, struct stat *to) { return __lxstat(KERNELS, path, to); }
HIDDEN int pthread_mutex_clocklock(pthread_mutex_t *mutex, clockid_t clock, const struct timespec *end) {
  struct timespec now, real;
  clock_gettime(clock, &now);
  clock_gettime(CLOCK_REALTIME, &real);
  real.tv_sec += end->tv_sec - now.tv_sec;
  real.tv_nsec += end->tv_nsec - now.tv_nsec;
  if (real.tv_nsec < 0) real.tv_nsec += 1000000000, --real.tv_sec;
  if (real.tv_nsec >= 1000000000) real.tv_nsec -= 1000000000, ++real.tv_sec;
  return pthread_mutex_timedlock(mutex, &real);
}
"""


def compiler_file(compiler, name):
    """The path of a library file of the compiler."""
    path = Path(run(compiler, f"-print-file-name={name}").strip())
    if not path.is_absolute():
        raise RuntimeError(f"the compiler has no {name}")
    return path.resolve()


def glibc_stubs(target, folder):
    """The stubs of glibc, which ziglang makes when it links a program."""
    cache = folder / "zig"
    (folder / "empty.c").write_text("int main(void) { return 0; }\n")
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache)}
    libraries = ["-lm", "-lpthread", "-ldl", "-lrt"]
    run(
        *zig("cc", "-target", target), folder / "empty.c", "-o", folder / "empty", *libraries, env=environment
    )
    (made,) = cache.rglob("libm.so.6")
    return [*(made.parent / name for name in GLIBC), *made.parent.glob("libld.so.*")]


def allowed(version):
    family, _, number = version.rpartition(".")
    return version in NEWEST or (number.isdigit() and int(number) <= NEWEST.get(family, -1))


def cxx_symbols(library):
    """Yields (name, kind, version) of the default symbols of libstdc++ with an allowed version."""
    for line in run("readelf", "--dyn-syms", "-W", library).splitlines():
        found = re.match(r"\s*\d+:\s+\w+\s+\w+\s+(FUNC|OBJECT|TLS)\s+\S+\s+\S+\s+\d+\s+(\S+?)@@(\S+)$", line)
        if found and allowed(found[3]):
            yield found[2], found[1], found[3]


def cxx_stub(compiler, folder):
    """A stub libstdc++.so.6 with the allowed symbols."""
    source, script, versions = [".text"], [], {}
    for name, kind, version in cxx_symbols(compiler_file(compiler, "libstdc++.so")):
        versions.setdefault(version, []).append(name)
        section = {"FUNC": ".text", "OBJECT": ".data", "TLS": '.section .tbss,"awT",@nobits'}[kind]
        kind = {"FUNC": "function", "OBJECT": "object", "TLS": "tls_object"}[kind]
        source += [section, f".globl {name}", f".type {name},@{kind}", f"{name}: .zero 8", f".size {name},8"]
    for version, names in versions.items():
        script.append(f"{version} {{ global: {' '.join(name + ';' for name in names)} }};")
    (folder / "cxx.s").write_text("\n".join(source) + "\n")
    (folder / "cxx.map").write_text("\n".join(script) + "\n")
    path = folder / "libstdc++.so.6"
    flags = [
        "-shared",
        "-nostdlib",
        "-Wl,-soname,libstdc++.so.6",
        f"-Wl,--version-script={folder / 'cxx.map'}",
    ]
    run(compiler, *flags, folder / "cxx.s", "-o", path)
    return path


def link_flags(platform, version, folder):
    """CMake definitions to link against glibc `version`, (major, minor), by stubs made in `folder`."""
    compiler = platform.compiler
    (folder / "compatible.c").write_text(COMPATIBLE)
    run(compiler, "-x", "c", "-O2", "-fPIC", "-c", folder / "compatible.c", "-o", folder / "compatible.o")
    glibc = glibc_stubs("{}.{}.{}".format(platform.target, *version), folder)
    libraries = [cxx_stub(compiler, folder), compiler_file(compiler, "libstdc++.a"), *glibc]
    # The last: functions of glibc that are linked statically into each library, such as atexit.
    libraries += [compiler_file(compiler, "libgcc_s.so.1"), folder / "compatible.o", *glibc[:2]]
    libraries += [compiler_file(compiler, name) for name in ("libgcc.a", "libc_nonshared.a")]
    flags = "-nodefaultlibs -s -Wl,--exclude-libs,ALL -Wl,--as-needed"
    return {
        "CMAKE_SHARED_LINKER_FLAGS": flags,
        "CMAKE_MODULE_LINKER_FLAGS": flags,
        "CMAKE_CXX_STANDARD_LIBRARIES": " ".join(map(str, libraries)),
    }
