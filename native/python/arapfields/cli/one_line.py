# SPDX-License-Identifier: GPL-3.0-or-later
import argparse

from .._streams import say


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that prints errors in one line, with exit code 2, and names the verb's help."""

    def error(self, message):
        say(f"{self.prog}: {message} (see {self.prog} --help)")
        raise SystemExit(2)

    def parse_known_args(self, args=None, namespace=None):
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown
