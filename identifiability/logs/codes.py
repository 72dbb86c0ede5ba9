"""Integers that are codes of signed numbers: two's complement, or a sign in the highest bit.

Registers of servos hold unsigned numbers. A signed number that crosses zero jumps there by half of
all codes, or by all of them. A column is decoded if that takes its jumps away.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array, ArrayByName
from identifiability.foundation.values import frozen

from .rules import RULES

#: Fewest bits of a register, and the usual ones.
FEWEST_BITS, REGISTER = 8, 16


@frozen
class Code:
    """The encoding of signed numbers as unsigned ones.

    Attributes
    ----------
    bits : int
        Bits of a number with its sign.
    sign_bit : bool
        Whether the highest bit is the sign of a magnitude; else it is two's complement.
    """

    bits: int
    sign_bit: bool

    @property
    def name(self) -> str:
        """Return a short description of the code."""
        if self.sign_bit:
            return f"numbers with their sign in bit {self.bits - 1}"
        return f"{self.bits}-bit numbers in two's complement"

    def decode(self, values: Array) -> Array:
        """Return the signed numbers (N,) of codes (N,)."""
        half = 2.0 ** (self.bits - 1)
        negative = half - values if self.sign_bit else values - 2 * half
        return np.where(values >= half, negative, values)

    def count_jumps(self, values: Array) -> tuple[int, int]:
        """Return the number of jumps of values (N,), as they are and decoded."""
        least = 0.5 * 2.0 ** (self.bits - 1)
        plain = int((np.abs(np.diff(values)) > least).sum())
        decoded = int((np.abs(np.diff(self.decode(values))) > least).sum())
        return plain, decoded

    def removes_jumps(self, values: Array) -> bool:
        """Return whether decoding removes nearly all jumps of values (N,)."""
        plain, decoded = self.count_jumps(values)
        return plain > 0 and decoded <= (1 - RULES.nearly_all) * plain

    def adds_jumps(self, values: Array) -> bool:
        """Return whether decoding adds jumps to values (N,)."""
        plain, decoded = self.count_jumps(values)
        return decoded > plain


def show_codes(values: ArrayByName) -> dict[str, Code]:
    """Return the codes that columns show, by the kind of column.

    Parameters
    ----------
    values : mapping of str to (N,)
        Columns by ``<joint>.<kind>``.
    """
    return {
        name.rpartition(".")[2]: code
        for name, x in values.items()
        if (code := find_code(x)) is not None
    }


def find_codes(values: ArrayByName, shown: Mapping[str, Code]) -> dict[str, Code]:
    """Return the codes of columns, by name.

    A column that is always negative does not show its code. Another one of its kind does, or the
    size of torque near the end of a register. A column to which decoding adds jumps has no code.
    Neither has then the other one of position and commanded position of that joint.

    Parameters
    ----------
    values : mapping of str to (N,)
        Columns by ``<joint>.<kind>``.
    shown : mapping of str to Code
        Codes by the kind of column, which columns of this log or of other logs show.
    """
    kinds = dict(shown)
    if "tau" not in kinds and any(
        is_negative(x) for name, x in values.items() if name.endswith(".tau")
    ):
        kinds["tau"] = Code(REGISTER, sign_bit=False)
    shared = {name: kinds.get(name.rpartition(".")[2]) for name in values}
    unfit = {
        _owner_of(name)
        for name, code in shared.items()
        if code is not None and code.adds_jumps(values[name])
    }
    return {
        name: code
        for name, code in shared.items()
        if code is not None
        and is_unsigned(values[name], code.bits)
        and _owner_of(name) not in unfit
    }


def _owner_of(column: str) -> str:
    """Return the joint of positions or commands, which share their zero; else the column."""
    joint, _, kind = column.rpartition(".")
    return joint if kind in ("q", "q_ref") else column


def describe_codes(codes: Mapping[str, Code]) -> Sequence[str]:
    """Return the columns of each code, half a sentence for each code."""
    groups: dict[str, list[str]] = {}
    for column, code in codes.items():
        groups.setdefault(code.name, []).append(f"'{column}'")
    return [f"{listing(columns, 4)} hold {name}" for name, columns in groups.items()]


def find_code(values: Array) -> Code | None:
    """Return the code of a column (N,); None if there is none, or the data do not show it."""
    known = values[np.isfinite(values)]
    if len(known) < RULES.fewest or not is_unsigned(known, 64):
        return None
    bits = max(int(known.max()).bit_length(), FEWEST_BITS)
    codes = (Code(bits, sign_bit=False), Code(bits, sign_bit=True))
    return next((code for code in codes if code.removes_jumps(known)), None)


def is_negative(values: Array) -> bool:
    """Return whether values (N,) lie in the last quarter of a register: small negative numbers."""
    known = values[np.isfinite(values)]
    if len(known) < RULES.fewest or not is_unsigned(known, REGISTER):
        return False
    # No sensor measures torque by such counts alone.
    return bool(known.min() >= 0.75 * 2**REGISTER)


def is_unsigned(values: Array, bits: int) -> bool:
    """Return whether values (N,) are unsigned integers of `bits` bits."""
    known = values[np.isfinite(values)]
    whole = (known == np.rint(known)) & (known >= 0) & (known < 2.0**bits)
    return bool(whole.all())
