# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m arapfields`. Exit codes: 0 done, 1 failed, 2 bad input or usage, 130 interrupted."""

import errno
import sys

from ._native import Cancelled, Diverged, InvalidInput
from ._streams import open_streams
from .cli.command_line import failed
from .cli.parser import parse

DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # not errors of the input


def main(arguments=None):
    """Runs a verb and returns the exit code; errors are printed as one line on stderr."""
    verb = "arapfields"
    open_streams()
    try:
        options = parse(sys.argv[1:] if arguments is None else arguments)
        verb = f"arapfields {options.verb}"
        options.run(options)
        return 0
    except SystemExit as stop:
        return stop.code or 0
    except (KeyboardInterrupt, Cancelled):
        return failed(verb, "interrupted", 130)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        return failed(verb, f"{where}{error.strerror or error}", 1 if error.errno in DISK else 2)
    except (InvalidInput, ImportError) as error:
        return failed(verb, error, 2)
    except (Diverged, MemoryError) as error:
        return failed(verb, str(error) or "out of memory", 1)


if __name__ == "__main__":
    sys.exit(main())
