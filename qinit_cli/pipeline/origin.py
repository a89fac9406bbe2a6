"""What an artefact says of its origin: the command that makes it, time, versions and platform."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_cli import __version__
from qinit_cli.registry import PLUG_IN

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Settings
    from qinit_store.held import Held


def provenance(
    command: Sequence[str], read: Path | Held | None = None, settings: Settings | None = None
) -> dict[str, str]:
    """The words that make an artefact, `-` replaced by what was read, with the time, versions and platform.

    Also which plug-ins had a part in what was read, or have one in what the `settings` name.
    """
    from qinit_cli.artefacts.settings import plug_ins

    typed = [str(_path_of(read)) if word == "-" and read is not None else word for word in command]
    return {
        "command": shlex.join(["qinit", *typed]),
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        **_surroundings(),
        **({} if read is None else plug_ins_behind(read)),
        **({} if settings is None else plug_ins(settings)),
    }


@cache
def _surroundings() -> dict[str, str]:
    import platform
    from importlib.metadata import version

    return {
        "qinit": __version__,
        **{package: version(package) for package in ("numpy", "scipy", "h5py", "numba")},
        "python": platform.python_version(),
        "platform": platform.platform(),
    }


def plug_ins_behind(read: Path | Held) -> dict[str, str]:
    """The plug-ins that an artefact was made with, as its provenance tells them."""
    from qinit_store.reading import describe

    origin = describe(read).provenance if isinstance(read, Path) else read.provenance
    return {key: str(value) for key, value in origin.items() if key.startswith(PLUG_IN)}


def _path_of(read: Path | Held) -> Path:
    return read if isinstance(read, Path) else read.path
