# SPDX-License-Identifier: GPL-3.0-or-later
"""The library on 64-bit ARM, under qemu: `python -m tests.arm64` (make test-arm64)."""
