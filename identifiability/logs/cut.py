"""Was a file cut? A last line without an end may lack digits that nobody misses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from identifiability.logs.form import Form

_NUMBER = re.compile(r"[-+]?\d*(?:[.,](\d*))?(?:[eE][-+]?(\d+))?")

#: A last line is whole, or cut, or nobody can tell.
End = Literal["whole", "cut", "unsure"]


def judge_end(line: str, others: Sequence[str], form: Form) -> End:
    """Return whether a line without an end is whole, by the form of other lines.

    Numbers of a fixed number of digits behind the point show it; of others the last digits may be
    missing, by which a number may be wrong by a power of ten.

    Parameters
    ----------
    line : str
        The last one.
    others : sequence of str
        Some of those before.
    form : Form
    """
    fields = form.split(line)
    if len(fields) < len(form.columns) or line.count('"') % 2:
        return "cut"
    last = fields[-1].strip()
    before = [row[-1].strip() for row in map(form.split, others) if len(row) == len(fields)]
    numbers = [match for text in before if text and (match := _NUMBER.fullmatch(text))]
    if not before or 2 * len(numbers) < len(before):  # a column of text
        return "whole" if last in before else "unsure"
    match = _NUMBER.fullmatch(last)
    if match is None or not last or not last[-1].isdigit():
        return "cut" if all(n[0][-1].isdigit() for n in numbers) else "unsure"
    decimals, exponents = ({len(n[k] or "") for n in numbers} for k in (1, 2))
    if len(match[2] or "") < min(exponents):
        return "cut"
    if min(exponents) > 0:
        return "whole" if len(exponents) == 1 else "unsure"
    if len(match[1] or "") < min(decimals) and not match[2]:
        return "cut"
    fixed = len(decimals) == 1 and min(decimals) > 0 and exponents == {0}
    return "whole" if fixed else "unsure"
