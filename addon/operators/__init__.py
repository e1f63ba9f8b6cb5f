# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin operators: they read the scene, hand work to the worker, and put results back."""
