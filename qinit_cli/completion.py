"""Names of artefacts for bash, listed before typer and the commands are imported: that takes longer than anybody waits for a Tab.

Whatever else is completed (options, another shell, a line with options or quotes, a configured store) is left to typer.
"""

import os
import re

FOLDERS = (
    "sources",
    "fits",
    "runs",
    "tunings",
)  # those of artefacts.kinds, whose import takes as long as typer's
ONE = {"fit", "salvage", "show"}  # commands whose one argument is an artefact
SEVERAL = {"compare", "export", "log", "merge", "verify"}  # and those that take any number
PLAIN = re.compile(r"[A-Za-z0-9._/ -]*")  # no quote, escape or variable, which a shell reads in its own way
SUFFIX = ".h5"


def names() -> list[str] | None:
    """The artefacts in the store whose names complete the line in COMP_WORDS; None where typer has to tell."""
    line = os.environ.get("COMP_WORDS", "")
    if os.environ.get("_QINIT_COMPLETE") != "complete_bash" or not PLAIN.fullmatch(line) or _configured():
        return None
    at = os.environ.get("COMP_CWORD", "")
    words = line.split()
    if not (at.isascii() and at.isdigit()) or int(at) not in (len(words) - 1, len(words)):
        return None
    given, begun = words[1 : int(at)], "".join(words[int(at) :])
    if any(word.startswith("-") for word in (*given, begun)):
        return None
    if not given or not (given[0] in SEVERAL or (given[0] in ONE and len(given) == 1)):
        return None
    store = os.environ.get("QINIT_STORE") or "qinit-store"
    return None if store.startswith("~") else _listed(store, begun)


def _configured() -> bool:
    """Whether a file, or a variable other than the store's, may have a say."""
    home = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    files = ("qinit.toml", os.path.join(home, "qinit", "qinit.toml"))
    others = [name for name in os.environ if name.startswith("QINIT_") and name != "QINIT_STORE"]
    return bool(others) or any(os.path.exists(file) for file in files)


def _listed(root: str, begun: str) -> list[str] | None:
    found = []
    for folder in FOLDERS:
        try:
            there = os.listdir(os.path.join(root, folder))
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:
            return None
        found += [name.removesuffix(SUFFIX) for name in there if name.endswith(SUFFIX) and name[0] != "."]
    return sorted(name for name in found if name.startswith(begun))
