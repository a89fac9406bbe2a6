"""The standard streams: open, whatever was closed, and able to carry whatever there is to print."""

from __future__ import annotations

import codecs
import io
import os
import sys
from typing import Any

ERRORS = "qinit"
STDOUT = "standard output"
PLAIN = {"–": "-", "−": "-", "×": "x", "·": ".", "’": "'"}  # of equal width: columns stay in line


def prepare() -> None:
    """Opens the null device in the place of closed streams, and makes no character an error.

    Else the next file to be opened would become stdout, and what is printed would be written into it. Names that are no text in
    the stream's encoding pass unchanged, so that paths arrive in the next command; a dash that it lacks becomes a hyphen,
    what else it lacks a question mark.
    """
    codecs.register_error(ERRORS, _replaced)
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if not _is_open(descriptor):
            os.set_inheritable(
                os.open(os.devnull, os.O_RDWR), True
            )  # gets the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, "w" if descriptor else "r", closefd=False))  # noqa: SIM115 for good
    _set_errors(sys.stdin, "surrogateescape")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout = _named(sys.stdout)
    _set_errors(sys.stderr, ERRORS)


def in_encoding_of(stream: object, path: str) -> str:
    """The path so that the stream writes its bytes, even where its encoding lacks the characters."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return os.fsencode(path).decode(encoding, "surrogateescape")


class _Stdout(io.FileIO):
    """Standard output, whose errors bear its name: the system's own name none."""

    def write(self, data: Any, /) -> int:
        """Writes as any file does."""
        try:
            return super().write(data)
        except OSError as error:
            error.filename = STDOUT
            raise


def _named(stream: io.TextIOWrapper) -> io.TextIOWrapper:
    """The stream anew, with errors that bear its name."""
    return io.TextIOWrapper(
        io.BufferedWriter(_Stdout(stream.fileno(), "w", closefd=False)),
        encoding=stream.encoding,
        errors=ERRORS,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def _set_errors(stream: object, errors: str) -> None:
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors=errors)


def _replaced(error: UnicodeError) -> tuple[str | bytes, int]:
    """The bytes that surrogates stand for, the nearest of ASCII, and question marks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    escaped = (0xDC80 <= ord(character) <= 0xDCFF for character in lacking)
    made = bytes(
        ord(character) - 0xDC00 if is_byte else ord(PLAIN.get(character, "?"))
        for character, is_byte in zip(lacking, escaped, strict=True)
    )
    return made, error.end
