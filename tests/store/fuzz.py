"""Artefacts with random damage, and what the reader makes of them: python fuzz.py SOUND FIRST COUNT, in a limited process.

Half of the damage is repaired as far as HDF5 can tell: the checksum of the object header that was hit is made to hold
again, so that its parser meets what no disk but somebody's hand would bring.
"""

from __future__ import annotations

import json
import random
import resource
import struct
import sys
from pathlib import Path

from qinit_store.errors import StoreError
from qinit_store.reading import open_artefact

MEMORY = 3 * 1024**3
SECONDS = 300


def values_of(path):
    """Everything a reader can get from an artefact that its digests cover: HDF5's checksums alone guard the rest."""
    with open_artefact(path) as artefact:
        names = [column.name for column in artefact.schema.columns if column.hashed]
        arrays = {name: artefact.read(name) for name in (*names, "task")}
        return {
            **{name: (values.dtype.str, values.shape, values.tobytes()) for name, values in arrays.items()},
            "said": json.dumps([artefact.spec, artefact.kind]),
            "axes": {name: axis.values.tobytes() for name, axis in artefact.axes.items() if name != "task"},
        }


def outcome(path, expected):
    """ "refused" or "harmless"; "wrong" where numbers were read that were never written."""
    try:
        found = values_of(path)
    except StoreError:
        return "refused"
    except MemoryError:
        return "out of memory"
    return "harmless" if found == expected else "wrong"


def damaged(content, seed):
    """The content with a few bytes changed, moved, cut or zeroed; every second one with checksums repaired."""
    probability = random.Random(seed)
    changed = bytearray(content)
    if seed % 2:
        return _header_damaged(changed, probability)
    for _ in range(probability.choice((1, 1, 2, 8))):
        at, length = probability.randrange(len(changed)), probability.choice((1, 1, 2, 4, 8, 64, 512))
        match probability.randrange(5):
            case 0:
                changed[at] ^= 1 << probability.randrange(8)
            case 1:
                changed[at : at + length] = probability.randbytes(len(changed[at : at + length]))
            case 2:
                changed[at : at + length] = bytes(len(changed[at : at + length]))
            case 3:
                source = probability.randrange(len(changed))
                changed[at : at + length] = changed[source : source + length]
            case 4:
                del changed[at : at + length]
    return bytes(changed)


def _header_damaged(content, probability):
    first, size = probability.choice(headers(content))
    for _ in range(probability.choice((1, 1, 2, 3))):
        content[probability.randrange(first + 6, first + size)] = probability.choice(
            (0, 1, 2, 4, 8, 16, 127, 128, 255, probability.randrange(256))
        )
    content[first + size : first + size + 4] = checksum(content[first : first + size])
    return bytes(content)


def headers(content):
    """(first byte, bytes before the checksum) of every object header of version 2 whose checksum holds."""
    found, at = [], content.find(b"OHDR")
    while at >= 0:
        flags = content[at + 5]
        width = 1 << (flags & 3)
        fixed = 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        size = fixed + width + int.from_bytes(content[at + fixed : at + fixed + width], "little")
        if content[at + size : at + size + 4] == checksum(content[at : at + size]):
            found.append((at, size))
        at = content.find(b"OHDR", at + 4)
    return found


def checksum(block):
    """The four bytes that HDF5 writes after a block of metadata."""
    return struct.pack("<I", lookup3(bytes(block)))


def lookup3(key):
    """Bob Jenkins' hash of 2006 (public domain)."""
    mask = 0xFFFFFFFF

    def turned(value, bits):
        return (value << bits | value >> (32 - bits)) & mask

    a = b = c = (0xDEADBEEF + len(key)) & mask
    if not key:
        return c
    padded = key + bytes(-len(key) % 12)
    blocks = [padded[at : at + 12] for at in range(0, len(padded), 12)]
    for number, block in enumerate(blocks):
        x, y, z = struct.unpack("<III", block)
        a, b, c = (a + x) & mask, (b + y) & mask, (c + z) & mask
        if number < len(blocks) - 1:
            a = (a - c) & mask ^ turned(c, 4)
            c = (c + b) & mask
            b = (b - a) & mask ^ turned(a, 6)
            a = (a + c) & mask
            c = (c - b) & mask ^ turned(b, 8)
            b = (b + a) & mask
            a = (a - c) & mask ^ turned(c, 16)
            c = (c + b) & mask
            b = (b - a) & mask ^ turned(a, 19)
            a = (a + c) & mask
            c = (c - b) & mask ^ turned(b, 4)
            b = (b + a) & mask
    for one, other, bits in (
        ("c", "b", 14),
        ("a", "c", 11),
        ("b", "a", 25),
        ("c", "b", 16),
        ("a", "c", 4),
        ("b", "a", 14),
        ("c", "b", 24),
    ):
        state = {"a": a, "b": b, "c": c}
        state[one] = ((state[one] ^ state[other]) - turned(state[other], bits)) & mask
        a, b, c = state["a"], state["b"], state["c"]
    return c


def main(sound, first, count):
    for limit, most in (
        (resource.RLIMIT_AS, MEMORY),
        (resource.RLIMIT_CPU, SECONDS),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(limit, (most, most))
    content, expected = sound.read_bytes(), values_of(sound)
    path = sound.with_name(f"damaged-{first}.h5")
    for seed in range(first, first + count):
        print(seed, end=" ", flush=True)
        path.write_bytes(damaged(content, seed))
        print(outcome(path, expected), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
