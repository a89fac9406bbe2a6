"""The command `qinit`, also `python -m qinit_cli`: signals are in order before anything heavy is imported."""

from __future__ import annotations

import sys

from qinit_cli import signals
from qinit_cli.errors import Interrupted


def main() -> None:
    """Runs the command line and exits with its code."""
    signals.install()
    try:
        from qinit_cli.app import run

        code = run(sys.argv[1:])
    except Interrupted as interrupted:
        code = interrupted.exit_code
    sys.exit(code)


if __name__ == "__main__":
    main()
