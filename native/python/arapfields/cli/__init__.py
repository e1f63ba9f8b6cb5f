# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line, `python -m arapfields`: one verb a step of the pipeline. See `--help`."""
