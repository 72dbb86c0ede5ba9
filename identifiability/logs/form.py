"""`Form`: how a table of text was written: separators, decimal commas, units, comments."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from identifiability.foundation.values import frozen
from identifiability.logs.aliases import find_unit, is_no_unit

# `Form`: how a table of text was written: separators, decimal commas, units, comments.
#
# It is decided once, on the first lines, before anything is read as a number.


#: Marks that begin a line of comment.
COMMENTS = ("#", "%", "//")

#: Separators of fields, and what notes call them; blanks are tried last.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "'|'", " ": "spaces"}


LINE_END = re.compile(r"\r\n|\r|\n")
_POINT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?(\d+,\d*|,\d+)([eE][-+]?\d+)?")


@frozen
class Form:
    """How a table was written.

    Attributes
    ----------
    encoding : str
    separator : str
        A blank stands for any number of blanks.
    decimal : str
    comment : str
        Mark of lines that are passed over; empty if there are none.
    columns : tuple of str
        Names in the header.
    units : tuple of str
        The row of units under the header; empty if there is none.
    lines : int
        Before the first row of numbers.
    notes : tuple of str
        What is read otherwise than literally, half a sentence each.
    """

    encoding: str = "utf-8"
    separator: str = ","
    decimal: str = "."
    comment: str = ""
    columns: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    lines: int = 0
    notes: tuple[str, ...] = ()

    def plain_text(self, piece: bytes) -> bytes:
        """Return some lines as UTF-8, without comments."""
        if self.encoding != "utf-8":
            piece = piece.decode(self.encoding, "replace").encode()
        if self.comment and self.comment.encode() in piece:
            mark = re.escape(self.comment.encode())
            piece = re.sub(rb"(?m)^[ \t]*" + mark + rb"[^\r\n]*(\r\n|\r|\n|$)", b"", piece)
        return piece

    def split(self, line: str) -> list[str]:
        """Return the fields of a line; one field if one is longer than any table's."""
        blank = self.separator == " "
        one = " ".join(line.split()) if blank else line
        try:
            return next(csv.reader([one], delimiter=self.separator, skipinitialspace=not blank), [])
        except csv.Error:  # of a long line, tried with a separator that it does not have
            return [line]

    def is_number(self, field: str) -> bool:
        """Whether a field is a number in this form."""
        text = field.strip()
        # Letters of the longest number.
        if len(text) > 400:
            return False
        return bool(_POINT.fullmatch(text) or (self.decimal == "," and _COMMA.fullmatch(text)))


#: Written as the documentation says.
PLAIN = Form()


#: How Windows writes Western text that is no Unicode; ISO 8859-1 has the same signs of units.
WESTERN = "cp1252"


def find_encoding(start: bytes) -> str:
    """Return how the first bytes of a text are encoded; text of one byte a letter is Western."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16-le" if start[0] == 0xFF else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)  # the last letter may be cut
    except UnicodeDecodeError:
        return WESTERN
    return "utf-8"


def find_form(text: str, encoding: str) -> Form:
    """Return the form of a table, from its first lines.

    Parameters
    ----------
    text : str
        Its beginning, without half a line at the end.
    encoding : str
    """
    # Lines on which the form is decided.
    lines = LINE_END.split(text.lstrip("\ufeff"))[:60]
    mark = _comment_mark(lines)
    form = Form(encoding=encoding, comment=mark)
    plain = [k for k, line in enumerate(lines) if line.strip() and not _is_comment(line, mark)]
    pairs = [(s, d) for s in SEPARATORS for d in ".," if not s == d == ","]
    forms = [replace(form, separator=s, decimal=d) for s, d in pairs]
    found = [f for f in (_try(form, lines, plain) for form in forms) if f is not None]
    best = max(found, key=lambda f: (len(f.columns), f.decimal == "."), default=None)
    if best is None or len(best.columns) < 2:  # no table of numbers: read as it stands
        first = plain[0] if plain else 0
        header = lines[first] if lines else ""
        return replace(form, columns=tuple(form.split(header)), lines=first + 1)
    return replace(best, notes=_notes(best, lines, plain))


def _try(form: Form, lines: Sequence[str], plain: Sequence[int]) -> Form | None:
    """Return the form with header and units, if the lines are a table in it."""
    rows = {k: form.split(lines[k]) for k in plain}
    counts = Counter(len(row) for row in rows.values())
    width = max(counts, key=lambda n: (counts[n], n), default=0)
    first = next((k for k, row in rows.items() if len(row) == width and _is_data(form, row)), None)
    if width < 2 or first is None:
        return None
    above = [k for k in plain if k < first and len(rows[k]) == width and _is_full(rows[k])]
    units: tuple[str, ...] = ()
    if len(above) > 1 and _are_units(rows[above[-1]]):
        units = tuple(field.strip() for field in rows[above.pop()])
    if above:
        columns = rows[above[0]]
        first = above[1] if len(above) > 1 else first  # what is neither is told of as data
    else:  # the header may stand in the last line of comment
        marked = [k for k in range(first) if _is_comment(lines[k], form.comment)]
        columns = form.split(lines[marked[-1]].strip().lstrip("#%/").strip()) if marked else []
    if len(columns) != width or any(form.is_number(c) for c in columns):
        return None
    if form.decimal == "," and not any(
        _COMMA.fullmatch(f.strip()) for r in rows.values() for f in r
    ):
        return None
    return replace(form, columns=tuple(columns), units=units, lines=first)


def _is_data(form: Form, row: Sequence[str]) -> bool:
    """Whether a row is one of numbers, some text or empty fields among them."""
    return sum(form.is_number(field) for field in row) >= max(2, len(row) // 2)


def _is_full(row: Sequence[str]) -> bool:
    """Whether a row is more than a title in its first field."""
    return 2 * sum(bool(field.strip()) for field in row) > len(row)


def _are_units(row: Sequence[str]) -> bool:
    units = [find_unit(field) for field in row]
    known = all(unit or is_no_unit(field) for unit, field in zip(units, row, strict=True))
    return known and any(units)


def _comment_mark(lines: Sequence[str]) -> str:
    """Return the mark of lines of comment, if there are any."""
    marks = [m for line in lines for m in COMMENTS if line.lstrip().startswith(m)]
    return marks[0] if marks else ""


def _is_comment(line: str, mark: str) -> bool:
    return bool(mark) and line.lstrip().startswith(mark)


def _notes(form: Form, lines: Sequence[str], plain: Sequence[int]) -> tuple[str, ...]:
    notes = []
    if form.encoding != "utf-8":
        name = {WESTERN: "Windows-1252"}.get(form.encoding, form.encoding[:6].upper())
        notes.append(f"its text is {name}")
    if form.separator != ",":
        notes.append(f"its fields are separated by {SEPARATORS[form.separator]}")
    if form.decimal == ",":
        notes.append("its numbers have decimal commas")
    if form.comment:
        notes.append(f"lines that begin with '{form.comment}' were passed over")
    if form.units:
        notes.append("the row under its header states units")
    before = [k for k in plain if k < form.lines - bool(form.units)]
    if len(before) > 1:
        notes.append(f"{len(before) - 1} line(s) above its header were passed over")
    return tuple(notes)
