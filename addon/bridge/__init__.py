# SPDX-License-Identifier: GPL-3.0-or-later
"""Between Blender's data and the core: arrays, handles, results, running jobs, drawing."""
