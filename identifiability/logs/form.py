"""`Form`: the format of a text table: separators, decimal commas, units, comments.

The first lines decide it once, before any number is read.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from identifiability.foundation.names import Strings
from identifiability.foundation.values import frozen

from .names import are_units

#: Marks that begin a line of comment.
COMMENTS = ("#", "%", "//")

#: Separators of fields, and their names in notes; blanks are tried last.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "'|'", " ": "spaces"}

#: How Windows writes Western text that is no Unicode; ISO 8859-1 has the same signs of units.
WESTERN = "cp1252"

#: Lines on which a form is decided, and letters of the longest number.
DECIDED, LONGEST = 60, 400

LINE_END = re.compile(r"\r\n|\r|\n")
_POINT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?(\d+,\d*|,\d+)([eE][-+]?\d+)?")


@frozen
class Form:
    """The format of a text table.

    Attributes
    ----------
    encoding : str
    separator : str
        Separator of columns; a blank means any number of blanks.
    decimal : str
    comment : str
        Mark of lines that are skipped; empty if there are none.
    columns : tuple of str
        Names in the header.
    units : tuple of str
        The row of units under the header; empty if there is none.
    lines : int
        Number of lines before the first row of numbers.
    notes : tuple of str
        Interpretations that are not literal, half a sentence each.
    """

    encoding: str = "utf-8"
    separator: str = ","
    decimal: str = "."
    comment: str = ""
    columns: Strings = ()
    units: Strings = ()
    lines: int = 0
    notes: Strings = ()

    def split(self, line: str) -> list[str]:
        """Return the fields of a line; one field if one is longer than any table's."""
        return next((fields for _, fields in self.rows([line])), [])

    def rows(self, lines: Sequence[str]) -> Iterator[tuple[int, list[str]]]:
        """Yield the line that each row begins at, and its fields; cells may hold ends of lines."""
        blank = self.separator == " "
        at = 0
        plain = ["" if self.is_comment(x) else " ".join(x.split()) if blank else x for x in lines]
        given = csv.reader(
            (f"{x}\n" for x in plain), delimiter=self.separator, skipinitialspace=not blank
        )
        try:
            for row in given:
                if any(cell.strip() for cell in row):
                    yield at, row
                at = given.line_num
        except csv.Error:  # of a long line, tried with a separator that it does not have
            yield at, list(lines[at : at + 1])

    def is_comment(self, line: str) -> bool:
        """Return whether a line is skipped."""
        return bool(self.comment) and line.lstrip().startswith(self.comment)

    def is_number(self, field: str) -> bool:
        """Return whether a field is a number in this form."""
        text = field.strip()
        if len(text) > LONGEST:
            return False
        return bool(_POINT.fullmatch(text) or (self.decimal == "," and _COMMA.fullmatch(text)))


#: The format of the documentation.
PLAIN = Form()


def find_encoding(start: bytes) -> str:
    """Return how the first bytes of a text are encoded; text of one byte a letter is Western."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        if start[0] == 0xFF:
            return "utf-16-le"
        return "utf-16-be"
    if start[1:2] == b"\0":  # a letter of two bytes, without a mark before it
        return "utf-16-le"
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
    lines = LINE_END.split(text.lstrip("\ufeff"))[:DECIDED]
    marks = (m for line in lines for m in COMMENTS if line.lstrip().startswith(m))
    form = Form(encoding=encoding, comment=next(marks, ""))
    pairs = [(s, d) for s in SEPARATORS for d in ".," if not s == d == ","]
    tried = (
        _try(
            replace(
                form,
                separator=s,
                decimal=d,
            ),
            lines,
        )
        for s, d in pairs
    )
    found = [f for f in tried if f is not None]
    if not found:  # no table of numbers: read literally
        at, header = next(form.rows(lines), (0, []))
        return replace(
            form,
            columns=tuple(header),
            lines=at + 1,
        )
    return max(found, key=lambda f: (len(f.columns), f.decimal == "."))


def _try(form: Form, lines: Sequence[str]) -> Form | None:
    """Return the form with header and units, if the lines are a table in it."""
    rows = list(form.rows(lines))
    counts = Counter(len(row) for _, row in rows)
    width = max(
        counts,
        key=lambda n: (counts[n], n),
        default=0,
    )
    numbers = [sum(map(form.is_number, row)) for _, row in rows]
    of_data = (
        k
        for k, (_, row) in enumerate(rows)
        if len(row) == width and numbers[k] >= max(2, width // 2)
    )
    first = next(of_data, None)
    if width < 2 or first is None:
        return None
    full = [k for k in range(first) if len(rows[k][1]) == width]  # more than a title
    full = [k for k in full if 2 * sum(bool(cell.strip()) for cell in rows[k][1]) > width]
    units: Strings = ()
    if len(full) > 1 and are_units(rows[full[-1]][1]):
        units = tuple(cell.strip() for cell in rows[full.pop()][1])
    if full:
        columns = [" ".join(c.split()) if "\n" in c else c for c in rows[full[0]][1]]
        first = full[1] if len(full) > 1 else first  # other cells count as data
    else:  # the header may be the last line of comment
        marked = [line for line in lines[: rows[first][0]] if form.is_comment(line)]
        bare = replace(form, comment="")
        columns = bare.split(marked[-1].strip().lstrip("#%/").strip()) if marked else []
    commas = any(_COMMA.fullmatch(cell.strip()) for _, row in rows for cell in row)
    if len(columns) != width or any(map(form.is_number, columns)):
        return None
    if form.decimal == "," and not commas:
        return None
    above = first - bool(units) - bool(full)
    form = replace(
        form,
        columns=tuple(columns),
        units=units,
        lines=rows[first][0],
    )
    return replace(form, notes=tuple(_notes(form, above)))


def _notes(form: Form, above: int) -> Iterator[str]:
    if form.encoding != "utf-8":
        name = {WESTERN: "Windows-1252"}.get(form.encoding, form.encoding[:6].upper())
        yield f"its text is {name}"
    if form.separator != ",":
        yield f"its fields are separated by {SEPARATORS[form.separator]}"
    if form.decimal == ",":
        yield "its numbers have decimal commas"
    if form.comment:
        yield f"lines that begin with '{form.comment}' were passed over"
    if form.units:
        yield "the row under its header states units"
    if above > 0:
        yield f"{above} line(s) above its header were passed over"
