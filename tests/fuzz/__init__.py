# SPDX-License-Identifier: GPL-3.0-or-later
"""Fuzzers of files of every kind and of calls with invalid arguments: `python -m tests.fuzz`.

Each case depends only on a seed and its number, and runs in a process with limits on memory and time.
"""
