# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs, progress, coroutines, workers and the loading of the native library; no bpy."""
