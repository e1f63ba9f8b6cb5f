# SPDX-License-Identifier: GPL-3.0-or-later
"""Nets: mutated files of every kind that is read, and calls with odd arguments. `python -m tests.fuzz`.

Each case is made from a seed and its number alone, and run in a process with limits on memory and time.
"""
