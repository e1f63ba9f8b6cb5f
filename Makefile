# SPDX-License-Identifier: GPL-3.0-or-later
# One word a purpose. Every word sets up what it needs in .venv (dependencies from PyPI).
# A Python that starts: names of pyenv's may lie in PATH and lead to none.
PATH_OF = $(shell $(1) -c 'import sys; print(sys.executable)' 2> /dev/null)
PYTHON ?= $(or $(call PATH_OF,python3.11),$(call PATH_OF,python3))
PYTHON313 ?= $(or $(call PATH_OF,python3.13),$(lastword $(sort $(wildcard $(HOME)/.pyenv/versions/3.13.*/bin/python3.13))))
SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
VENV := .venv
PY := $(VENV)/bin/python
SOURCES := $(shell find native cmake -type f) CMakeLists.txt pyproject.toml
PIP := $(PY) -m pip install --disable-pip-version-check
PYTEST := $(PY) -m pytest
# Files of tests are dealt out, long ones first, to as many processes as there are processors; each needs memory.
# There, a thread of libtorch's or numpy's that waits must not hold the processor that another process needs.
# Compiled Python is kept, also where it is told to keep none: each Blender would compile the extension again.
BYTECODE := PYTHONDONTWRITEBYTECODE= PYTHONPYCACHEPREFIX=$(abspath build/bytecode)
ENVIRONMENT := OMP_WAIT_POLICY=passive OPENBLAS_NUM_THREADS=1 $(BYTECODE)
AT_ONCE := -n logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder
ALL_TESTS := $(ENVIRONMENT) $(PYTEST) $(AT_ONCE)
# BACKEND=eigen: the library without libtorch, as wheels and zips have it, in a folder of its own beside .venv's.
BACKEND := torch
TORCH := $(VENV)/.torch
BLENDER := $(VENV)/.blender
ifeq ($(BACKEND),eigen)
LIBRARIES :=
BUILD := build/eigen
INSTALLED := $(BUILD)/.installed
INTO := --target $(abspath $(BUILD)/site) --upgrade
export PYTHONPATH := $(abspath $(BUILD)/site)
else
LIBRARIES := $(TORCH)
BUILD := build/wheel
INSTALLED := $(VENV)/.installed
INTO := --force-reinstall
endif
NATIVE_TESTS := $(BUILD)/tests/native_tests
export ARAPFIELDS_NATIVE_TESTS := $(NATIVE_TESTS)

.PHONY: help setup build examples demo test test-slow test-rounding test-window test-windows test-arm64 fuzz fuzz-contact bench sanitize format lint wheels extension release blenders test-blender gallery docs clean

help:  ## this list
	@grep -E '^[a-z0-9-]+:.*##' Makefile | sed -E 's/:.*##/ -/'

# What is not at hand is said in one line, before anything is fetched.
lacks = { echo "$(1)"; exit 1; }
BASE = $(or $(wildcard $(PY)),$(PYTHON))
define COMPILER
	@command -v c++ > /dev/null || $(call lacks,A C++20 compiler is needed (Debian: g++))
	@test -e "$$($(BASE) -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" || \
	  $(call lacks,The headers of Python 3.11 are needed (Debian: python3.11-dev))
endef

$(VENV)/.ready: requirements.txt
	@$(or $(BASE),false) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2> /dev/null || \
	  $(call lacks,Python 3.11 is needed: Blender's module is for no other (Debian: python3.11; PYTHON=path names one))
	$(COMPILER)
	@test -x $(PY) || $(PYTHON) -m venv $(VENV) > /dev/null || { rm -rf $(VENV); \
	  echo "Python's venv module is needed (Debian: python3.11-venv)"; exit 1; }
	@echo "Fetching tools from PyPI into $(VENV), once."
	@$(PIP) -q --upgrade "pip>=24"
	@$(PIP) -q -r requirements.txt
	@touch $@

$(TORCH): native/tensors/torch/requirements.txt $(VENV)/.ready
	@echo "Fetching libtorch into $(VENV): large, once."
	@$(PIP) -r $<
	@touch $@

$(BLENDER): blender_scripts/requirements.txt $(VENV)/.ready
	@echo "Fetching Blender as a Python module into $(VENV): large, once."
	@$(PIP) -r $<
	@$(PY) blender_scripts/system_libraries.py
	@touch $@

# What only testing and checking need.
$(VENV)/.tools: tests/requirements.txt $(TORCH) $(BLENDER)
	@$(PIP) -q -r tests/requirements.txt
	@# Headers of Boost.Test alone are used; the wheel's numpy>=2 (for Boost.Python) would clash with bpy 4.5's.
	@$(PIP) -q --no-deps cmeel-boost==1.90.0
	@touch $@

setup: $(VENV)/.tools  ## .venv with all that building and testing needs

# The wheel's build folder is kept, so a rebuild compiles only what changed.
$(INSTALLED): $(VENV)/.ready $(LIBRARIES) $(SOURCES)
	$(COMPILER)
	@echo "Compiling the native library. Some minutes the first time; all output: build/build.log"
	@mkdir -p $(BUILD)
	@$(PIP) -v --no-build-isolation --no-deps $(INTO) -C build-dir=$(BUILD) \
	  -C cmake.define.ARAPFIELDS_BACKEND=$(BACKEND) -C cmake.define.ARAPFIELDS_WERROR=ON . 2>&1 | tee build/build.log | \
	  while read -r line; do case "$$line" in "["[1-9]*/*"]"*) line="$${line%%]*}"; done="$${line%/*}"; done="$${done#[}"; \
	  left=$$((SECONDS * ($${line#*/} - done) / done)); printf '\r  %s], %d min %02d s left  ' "$$line" $$((left / 60)) $$((left % 60));; esac; done \
	  || { tail -n 60 build/build.log; exit 1; }
	@echo
	@touch $@

build: $(INSTALLED)  ## the Python package, installed in .venv; BACKEND=eigen: without libtorch, in build/eigen/site

$(NATIVE_TESTS): $(INSTALLED) $(VENV)/.tools $(shell find tests/native -type f)
	$(VENV)/bin/cmake -S . -B $(BUILD) -DARAPFIELDS_NATIVE_TESTS=ON > build/native_tests.log || { cat build/native_tests.log; exit 1; }
	$(VENV)/bin/cmake --build $(BUILD) --target native_tests
	@touch $@

examples: build $(BLENDER)  ## the scenes of the workflow pages: out/examples
	$(PY) blender_scripts/examples.py --output out/examples

demo: build $(BLENDER)  ## pins, a hat carried, a style and a wrap on a dog: out/demo.png and out/demo.blend
	$(PY) blender_scripts/demo.py --output out

TESTS := tests
test: build $(NATIVE_TESTS)  ## all tests but the slow ones; TESTS="tests/python …" names some
	$(ALL_TESTS) -m "not slow" $(TESTS)

# Those of tests/packaging compile the library and build packages: they are in no part.
test-slow: build $(NATIVE_TESTS)  ## every test; PART=N takes a tenth of the slow ones, all in turn as N rises
	$(ALL_TESTS) $(if $(PART),--slow-part $(PART) $(addprefix tests/,addon_core blender docs python),tests)

# TESTS="tests/python/… …" names some, LEVELS="baseline avx2 …" and NUDGES="0 1 …" conditions; PART=N takes a few
# minutes' part of all. BACKEND takes one of the two.
test-rounding:  ## the tests as other processors round, and with shapes moved by 1e-7 of their size, on both backends
	@failed=0; for backend in $(if $(filter command line,$(origin BACKEND)),$(BACKEND),torch eigen); do \
	  $(MAKE) --no-print-directory test-rounding-here BACKEND=$$backend || failed=1; done; exit $$failed

.PHONY: test-rounding-here
test-rounding-here: build $(NATIVE_TESTS)
	@$(ENVIRONMENT) $(PY) -m tests.rounding --pytest="$(AT_ONCE)" $(if $(LEVELS),--levels "$(LEVELS)") \
	  $(if $(NUDGES),--nudges "$(NUDGES)") $(if $(PART),--part $(PART)) $(filter-out tests,$(TESTS))

# Debian: g++-mingw-w64-x86-64-posix and wine64. WINDOWS takes arguments: WINDOWS="--python 3.13", files of tests.
WINE := $(shell command -v wine64 || ls /usr/lib/wine/wine64 2> /dev/null)
WINDOWS_BUILD := build/windows-x64

.PHONY: windows-tools
windows-tools:
	@command -v x86_64-w64-mingw32-g++-posix > /dev/null || \
	  $(call lacks,A compiler for Windows is needed (Debian: g++-mingw-w64-x86-64-posix))
	@test -n "$(WINE)" || $(call lacks,Wine is needed (Debian: wine64))

test-windows: windows-tools setup  ## the zip for Windows; its library's native tests, the tests of Python and the zip itself under Wine
	$(MAKE) --no-print-directory extension PLATFORM=windows-x64
	$(VENV)/bin/cmake -S . -B $(WINDOWS_BUILD) -DARAPFIELDS_NATIVE_TESTS=ON
	$(VENV)/bin/cmake --build $(WINDOWS_BUILD) --target native_tests
	WINEPREFIX=$(abspath build/wine) WINEDEBUG=-all timeout 900 $(WINE) $(WINDOWS_BUILD)/tests/native_tests.exe --color_output=no --report_level=short
	$(PY) -m tests.windows dist $(WINDOWS)

# Debian: g++-aarch64-linux-gnu and qemu-user-static. Debian's libgcc asks for a newer glibc than the wheels may.
ARM64 := build/linux-arm64
test-arm64: setup  ## the wheels' library for 64-bit ARM, and its native tests under qemu
	@command -v qemu-aarch64-static > /dev/null || $(call lacks,An emulator is needed (Debian: qemu-user-static))
	$(MAKE) --no-print-directory wheels PLATFORM=linux-arm64
	$(VENV)/bin/cmake -S . -B $(ARM64) -DARAPFIELDS_NATIVE_TESTS=ON -DCMAKE_EXE_LINKER_FLAGS=-Wl,--allow-shlib-undefined
	$(VENV)/bin/cmake --build $(ARM64) --target native_tests
	qemu-aarch64-static -L /usr/aarch64-linux-gnu $(ARM64)/tests/native_tests --color_output=no --report_level=short

# ARAPFIELDS_WINDOW names a Blender with a window that imports arapfields [blender]; WINDOW_PARTS="panel use …" some checks.
test-window: build  ## the extension in a real window, by mouse and keys; needs a display, xdotool and ImageMagick
	@test -n "$$DISPLAY" || $(call lacks,A display is needed (Debian: xvfb; xvfb-run make test-window))
	@command -v xdotool > /dev/null && command -v import > /dev/null || $(call lacks,The mouse and pictures need xdotool and import (Debian: xdotool imagemagick))
	$(PY) -m tests.gui $(WINDOW_PARTS)

fuzz: build $(VENV)/.tools  ## the nets, long: 20,000 odd calls and 20,000 damaged files of every kind, 10,000 steps of a walk through Blender
	$(PY) -m tests.fuzz
	$(PY) -m tests.fuzz.walk

# PEERS=path names a folder with checkouts of implicit-arap and gaussStylization: these are then run, too.
bench: build $(VENV)/.tools  ## paired benchmarks against the real competitors; PEERS=path: against others' public code
	$(PIP) -q -r tests/benchmarks/requirements.txt
	PEERS="$(PEERS)" $(PY) -m tests.benchmarks $(if $(PEERS),peers)

SANITIZED = $(VENV)/bin/cmake -S . -G Ninja -DPython_EXECUTABLE=$(abspath $(PY)) -DCMAKE_MAKE_PROGRAM=$(abspath $(VENV)/bin/ninja) \
  -DCMAKE_BUILD_TYPE=RelWithDebInfo -DARAPFIELDS_NATIVE_TESTS=ON -DARAPFIELDS_WERROR=ON

# libtorch is not made for the thread sanitizer, which would find what is not there: that one takes Eigen.
# Neither sanitizer follows forks (a child may inherit the address sanitizer's allocator locked): the tests that make
# them are left out.
sanitize: setup  ## the native tests under the address and undefined-behaviour sanitizers, those of threads and the live solver under the thread sanitizer
	$(COMPILER)
	$(SANITIZED) -B build/sanitize -DARAPFIELDS_SANITIZE=address,undefined
	$(VENV)/bin/cmake --build build/sanitize --target native_tests
	ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=0 UBSAN_OPTIONS=print_stacktrace=1 build/sanitize/tests/native_tests --run_test='!@fork'
	$(SANITIZED) -B build/sanitize-thread -DARAPFIELDS_SANITIZE=thread -DARAPFIELDS_BACKEND=eigen -DARAPFIELDS_PYTHON=OFF
	$(VENV)/bin/cmake --build build/sanitize-thread --target native_tests
	build/sanitize-thread/tests/native_tests --run_test=threads --run_test='!@fork'

# The Eigen backend, which the sanitizers see into.
SCENES := 2000
FIRST := 0
fuzz-contact: setup  ## 2,000 random scenes in contact under the address and undefined-behaviour sanitizers; SCENES=count FIRST=number: others
	$(COMPILER)
	$(SANITIZED) -B build/sanitize-eigen -DARAPFIELDS_SANITIZE=address,undefined -DARAPFIELDS_BACKEND=eigen -DARAPFIELDS_PYTHON=OFF \
	  -DARAPFIELDS_NATIVE_SUITES=contact
	$(VENV)/bin/cmake --build build/sanitize-eigen --target native_tests
	UBSAN_OPTIONS=print_stacktrace=1 ARAPFIELDS_CONTACT_SCENES="$(FIRST) $(SCENES)" build/sanitize-eigen/tests/native_tests --run_test=contact/scenes

# What these words read from git; an unpacked archive has none.
.PHONY: git-clone
git-clone:
	@test . -ef "$$(git rev-parse --show-toplevel 2> /dev/null)" || $(call lacks,A clone made by git is needed: this word asks git for its files)

# The versions stand in tests/requirements.txt.
$(VENV)/.format: tests/requirements.txt $(VENV)/.ready
	@grep -E '^(ruff|clang-format)==' $< | $(PIP) -q -r /dev/stdin
	@touch $@

format: git-clone $(VENV)/.format  ## clang-format and ruff over our files
	git ls-files '*.h' '*.cpp' | xargs $(VENV)/bin/clang-format -i
	$(VENV)/bin/ruff format -q . && $(VENV)/bin/ruff check -q --fix .

lint: git-clone $(VENV)/.format  ## the same, checking alone
	git ls-files '*.h' '*.cpp' | xargs $(VENV)/bin/clang-format --dry-run --Werror
	$(VENV)/bin/ruff format --check -q . && $(VENV)/bin/ruff check .

# linux-arm64 needs Debian's g++-aarch64-linux-gnu, windows-x64 its g++-mingw-w64-x86-64-posix.
PLATFORM := linux-x64
.PHONY: wheel-tools
wheel-tools: $(VENV)/.ready
	$(COMPILER)
	@$(PIP) -q -r cmake/wheel/requirements.txt

wheels: wheel-tools  ## for pip, in dist: wheels for Python 3.11 to 3.14; PLATFORM=linux-arm64, windows-x64, windows-arm64, macos-arm64, macos-x64 or all
	$(PY) cmake/wheel/build_wheels.py $(PLATFORM) $(WHOLE) --output dist

extension: wheels $(BLENDER)  ## for Blender: dist/arapfields-<version>-linux-x64.zip, of these wheels; PLATFORM as above
	$(PY) blender_scripts/build_extension.py $(PLATFORM) --output dist

release: git-clone  ## all that is published, in dist: wheels, zips, index.json, source distribution, licences, checksums
	$(MAKE) --no-print-directory extension PLATFORM=all WHOLE=--whole
	$(PY) cmake/wheel/release.py --output dist

# What PyPI has of other Blenders, for tests/blender/test_extension.py; those from 5.1 on need a Python 3.13.
NEWER := $(shell awk '$$2 == "3.13" {print "build/blenders/" $$1 "/.ready"}' tests/support/blender/versions.txt)
blenders: build/blenders/4.2/.ready $(if $(PYTHON313),$(NEWER))  ## other Blenders to test the extension in: build/blenders
	@$(if $(PYTHON313),,echo "no python3.13 (PYTHON313=…): Blenders from 5.1 on are left out")

build/blenders/4.2/.ready:
	$(PYTHON) -m venv build/blenders/4.2
	build/blenders/4.2/bin/python -m pip install -q "bpy==4.2.*" "numpy<2" torch==2.13.0
	build/blenders/4.2/bin/python -m pip install -q --no-deps --target build/blenders/numpy2 "numpy==2.*"
	@touch $@

$(NEWER): build/blenders/%/.ready:
	$(PYTHON313) -m venv build/blenders/$*
	build/blenders/$*/bin/python -m pip install -q "bpy==$*.*"
	@touch $@

# The library is that of the wheel, which serves all their Pythons. TESTS="tests/blender/… …" names some.
VERSION := 5.3
OTHER := build/blenders/$(VERSION)
OTHER_SITE := build/blenders/site
test-blender: setup wheels blenders  ## the tests of tests/blender in another Blender: VERSION=5.3 (or 5.2, 4.2)
	@test -x $(OTHER)/bin/python || $(call lacks,No Blender $(VERSION) in build/blenders)
	$(OTHER)/bin/python -m pip install -q --disable-pip-version-check -r tests/support/blender/requirements.txt
	rm -rf $(OTHER_SITE) && $(PIP) -q --no-deps --target $(OTHER_SITE) dist/arapfields-*cp311*manylinux*_x86_64.whl
	ARAPFIELDS_WORKER=$(abspath $(OTHER)/bin/python) PYTHONPATH=$(abspath $(OTHER_SITE)) \
	  $(ALL_TESTS) -rs -m "not slow" --ignore tests/blender/test_extension.py $(or $(filter-out tests,$(TESTS)),tests/blender)

gallery: build $(VENV)/.tools  ## the documentation's pictures, rendered by the code
	$(PIP) -q -r docs/requirements.txt
	$(PY) blender_scripts/gallery.py --output docs/gallery; status=$$?; $(PY) docs/hooks/measured.py && exit $$status

docs: build  ## the documentation site in site/
	$(PIP) -q -r docs/requirements.txt
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict

clean:  ## removes build products (.venv stays)
	rm -rf build dist out site $(VENV)/.installed
