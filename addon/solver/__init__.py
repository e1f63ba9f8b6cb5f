# SPDX-License-Identifier: GPL-3.0-or-later
"""From a request (pose, style, frame) to a shape: no display, no thread, no modifier."""
