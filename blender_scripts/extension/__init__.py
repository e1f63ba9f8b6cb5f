# SPDX-License-Identifier: GPL-3.0-or-later
"""What build_extension.py is made of: private libraries, bindings for several Pythons, a wheel, a zip."""
