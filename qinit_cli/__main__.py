"""The command `qinit`, also `python -m qinit_cli`: its path and its signals are in order before anything else is imported."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Runs the command line and exits with its code."""
    _leave_the_current_folder()
    import signal

    for number in (signal.SIGINT, signal.SIGTERM):  # while what knows better is imported
        signal.signal(number, lambda number, frame: os._exit(128 + number))
    if "_QINIT_COMPLETE" in os.environ:
        from qinit_cli import completion

        if (names := completion.names()) is not None:
            sys.stdout.write("\n".join(names) + "\n")
            return
    from qinit_cli import signals
    from qinit_cli.errors import Interrupted

    try:
        signals.install()
        from qinit_cli import streams

        streams.prepare()
        from qinit_cli.app import run

        code = run(sys.argv[1:])
    except Interrupted as interrupted:
        code = interrupted.exit_code
    signals.end_from_now_on()
    sys.exit(signals.exit_code() or code)


def _leave_the_current_folder() -> None:
    """Takes the current folder off the path: a numpy.py that lies there is not meant.

    It stands there by `python -m`, or by an empty entry of PYTHONPATH, as in ":lib"; who names it, as ".", means it.
    """
    if __name__ == "__main__" and not sys.flags.safe_path:
        del sys.path[0]
    named = [] if sys.flags.ignore_environment else os.environ.get("PYTHONPATH", "").split(os.pathsep)
    try:
        here = os.getcwd()
    except OSError:  # it was deleted
        return
    if "" in named and not any(entry and os.path.abspath(entry) == here for entry in named):
        sys.path[:] = [entry for entry in sys.path if entry not in ("", here)]


if __name__ == "__main__":
    main()
