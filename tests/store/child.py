"""A process of its own that makes an artefact: python child.py WHAT PATH ...

Says on stdout what it has reached, one word a line, so that a test can kill it there or compare with what is kept.
"""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import numpy as np
from fakes import LIGHT, narrow_schema, rows_for, spec_for, statics_for

from qinit_store.errors import StoreError
from qinit_store.reading import open_artefact
from qinit_store.work import open_work


def say(word):
    print(word, flush=True)


def make(path, tasks, hold=False, force=False):
    """Save one task at a time, saying each; with `hold`, keep the lock until stdin ends."""
    with open_work(path, LIGHT, spec_for(tasks), force=bool(force)) as work:
        say("ready")
        if hold:
            sys.stdin.read()
        for number in np.setdiff1d(np.arange(tasks), work.saved).tolist():
            work.save(rows_for([number], LIGHT), np.array([number]))
            say(number)
        work.finish(np.arange(tasks), statics_for(LIGHT))


def finish_large(path, tasks, kilobytes):
    """Say the memory in MB before any work, after the parts, and after publishing and reading by blocks."""
    schema = narrow_schema(kilobytes * 1024 // 8, keep_q=True)
    pattern = np.tile(np.arange(64.0), kilobytes * 1024 // 8 // 64)
    say(peak())
    with open_work(path, schema, spec_for(tasks)) as work:
        for first in range(0, tasks, 16):
            ids = np.arange(first, min(first + 16, tasks))
            short = {"steps": np.ones((ids.size, 3), "i4"), "reached": np.ones((ids.size, 3), "u1")}
            table = (pattern + ids[:, None])[:, :, None]
            work.save({"q": table, "seconds": np.ones(ids.size), **short}, ids)
        say(peak())
        work.finish(np.arange(tasks), statics_for(schema))
    with open_artefact(path) as artefact:
        for block in artefact.blocks(["q"], 16):
            assert np.array_equal(block["q"][:, :, 0], pattern + block["task"][:, None])
    say(peak())


def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


if __name__ == "__main__":
    what, where, *more = sys.argv[1:]
    try:
        {"make": make, "finish_large": finish_large}[what](Path(where), *map(int, more))
    except StoreError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
