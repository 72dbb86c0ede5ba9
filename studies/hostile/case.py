"""`Hostile`: one hostile file, and the command that reads it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

#: The command that reads a file of a kind; ``{}`` is the file, ``good.csv`` lies beside it.
COMMANDS: dict[str, tuple[str, ...]] = {
    "urdf": ("inspect", "{}"),
    "mjcf": ("inspect", "{}"),
    "sdf": ("inspect", "{}"),
    "sidecar": ("inspect", "five-bar", "--sidecar", "{}"),
    "dh": ("convert", "{}", "--out", "made.xml"),
    "ladder": ("inspect", "two-link", "--model", "{}"),
    "limits": (
        "excite", "two-link", "--limits", "{}", "--evaluations", "1", "--samples", "20",
        "--engine", "serial", "--out", "made.json",
    ),
    "log": ("inspect", "two-link", "{}", "--engine", "serial"),
    "fit": ("predict", "two-link", "{}", "good.csv"),
    "values": ("export", "two-link", "{}", "--out", "made.json"),
    "trajectory": ("simulate", "two-link", "{}", "--samples", "30", "--out", "made.csv"),
}  # fmt: skip

Make = Callable[[Path], None]


@dataclass(frozen=True)
class Hostile:
    """One hostile file.

    Attributes
    ----------
    reader : str
        What reads it, as the tables of the study call it.
    name : str
        What is hostile about it.
    file : str
        Its name in a folder of its own.
    make : callable(Path)
        Puts it, and what belongs to it, into that folder.
    words : tuple of str
        The command line.
    must_fail : bool
        Whether reading it right is impossible.
    """

    reader: str
    name: str
    file: str
    make: Make
    words: tuple[str, ...]
    must_fail: bool = False


def hostile(
    reader: str,
    name: str,
    content: bytes | str | Make,
    *,
    kind: str = "",
    file: str = "",
    suffix: str = "",
    must_fail: bool = False,
) -> Hostile:
    """Return a hostile file of some content, or whatever a function puts in its place.

    Parameters
    ----------
    reader, name : str
    content : bytes, str or callable(Path)
    kind : str
        Key of `COMMANDS`; the reader's name by default.
    file, suffix : str
        Its name, or the ending of ``hostile``.
    must_fail : bool
    """
    kind, file = kind or reader, file or f"hostile{suffix}"
    words = tuple(word.replace("{}", file) for word in COMMANDS[kind])

    def make(folder: Path) -> None:
        if callable(content):
            content(folder / file)
        else:
            whole = (
                content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
            )
            (folder / file).write_bytes(whole)

    return Hostile(reader, name, file, make, words, must_fail)


def no_files(reader: str, suffix: str, kind: str = "") -> list[Hostile]:
    """Return what stands where a file should: a folder, a pipe, a device, links."""

    def link(target: str) -> Make:
        return lambda path: path.symlink_to(target)

    def ring(path: Path) -> None:
        path.symlink_to(path.with_name("other"))
        path.with_name("other").symlink_to(path.name)

    places: dict[str, Make] = {
        "a folder": Path.mkdir,
        "a pipe": os.mkfifo,
        "a link to /dev/zero": link("/dev/zero"),
        "a link to /dev/tty": link("/dev/tty"),
        "a link to nothing": link("nowhere"),
        "links in a ring": ring,
        "a link to a folder": link("."),
    }
    return [
        hostile(reader, name, make, suffix=suffix, kind=kind, must_fail=True)
        for name, make in places.items()
    ]


def spoilt(
    reader: str, good: bytes, suffix: str, count: int, kind: str = "", seed: int = 19
) -> list[Hostile]:
    """Return a good file cut at random places, and with bits turned at random."""
    rng = np.random.default_rng([seed, *reader.encode()])
    out = []
    for k in range(count):
        if k % 2:
            content, name = bytearray(good), f"bits turned, {k // 2 + 1}"
            for at in rng.integers(len(good), size=int(rng.integers(1, 40))):
                content[at] ^= 1 << int(rng.integers(8))
        else:
            content, name = bytearray(good[: rng.integers(len(good))]), f"cut, {k // 2 + 1}"
        out.append(hostile(reader, name, bytes(content), suffix=suffix, kind=kind))
    return out


def encoded(reader: str, good: str, suffix: str, kind: str = "") -> list[Hostile]:
    """Return a good text in codes that it does not say, with marks of several, and with zeros."""
    half = len(good) // 2
    texts = {
        "UTF-16": good.encode("utf-16"),
        "UTF-16 without a mark": good.encode("utf-16-be"),
        "UTF-32": good.encode("utf-32"),
        "Latin-1": good.replace("a", "\xe4").encode("latin-1", "replace"),
        "mark of UTF-16, text of UTF-8": b"\xff\xfe" + good.encode(),
        "marks of two codes": b"\xef\xbb\xbf\xff\xfe" + good.encode(),
        "half UTF-8, half UTF-16": good[:half].encode() + good[half:].encode("utf-16-le"),
        "zeros inside": good.replace("o", "\0").encode(),
        "zeros at the end": good.encode() + b"\0" * 100_000,
        "nothing but zeros": b"\0" * 100_000,
        "empty": b"",
        "random bytes": np.random.default_rng(19).bytes(50_000),
    }
    return [hostile(reader, name, text, suffix=suffix, kind=kind) for name, text in texts.items()]


#: Names that a terminal, a spreadsheet, a page or a path would obey, or that nobody can read.
NAMES: dict[str, str] = {
    "escape sequences": "\x1b[2J\x1b]0;owned\x07",
    "eight-bit escapes": "\x9b2J\x9d0;owned\x9c",
    "text from right to left": "a\u202egpj.exe",
    "a formula": "=cmd|'/C calc'!A0",
    "markup": "<script>alert(1)</script>[red]",
    "a path": "../../etc/passwd",
    "very long": "x" * 200_000,
    "a line end": "a\nError: all is well.",
    "half a letter": "\ud800",
    "format letters": "{0.__class__}%s%n${HOME}$(id)`id`",
}

#: Numbers that are none, or that no machine holds.
NUMBERS = (
    "nan", "inf", "-inf", "1e999", "-1e308", "1e-320", "9" * 5000, "1e99999999999", "0x10",
    "1,5", "", "٣", "1_000", "--1", "1e",
)  # fmt: skip


def listed(*groups: Sequence[Hostile]) -> list[Hostile]:
    """Return the files of some groups."""
    return [file for group in groups for file in group]


def sparse(start: bytes, size: int, fill: bytes = b"") -> Make:
    """Return what makes a large file of zeros, or of one piece again and again."""

    def make(path: Path) -> None:
        with path.open("wb") as file:
            file.write(start)
            if not fill:
                file.truncate(size)
                return
            block = fill * (1_000_000 // len(fill))
            for _ in range(size // len(block)):
                file.write(block)

    return make


class Runs:
    """What makes a file when it is unpickled."""

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return os.system, ("touch canary",)
