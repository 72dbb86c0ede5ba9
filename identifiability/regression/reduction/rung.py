"""`Rung`: one model of a ladder over base parameters, as columns and a held torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from identifiability.foundation.errors import ModelError, listing, near_match
from identifiability.foundation.names import Array, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.regression.base_parameters import BaseParameters
from identifiability.regression.information import Information
from identifiability.regression.reduction.file import LadderEntry, RungEntry
from identifiability.regression.structure import Structure


@frozen
class Rung:
    """One model of a ladder: columns ``W_base M`` and torque ``τ - W_base held``.

    Attributes
    ----------
    name, description : str
    columns, labels, units : tuple of str
        Of its m parameters.
    M : (b, m)
        Base parameters from the rung's: ``beta = held + M x``.
    held : (b,)
        Values of base parameters that are held.
    nonnegative : (m,) bool
        Whether physics forbids a value below zero.
    """

    name: str
    description: str
    columns: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    M: Array
    held: Array
    nonnegative: np.ndarray

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.columns)

    def reduce(self, information: Information) -> Information:
        """Return the information about the rung's parameters."""
        return information.reduce(self.M, self.columns, self.held)

    def expand(self, value: Array) -> Array:
        """Return base parameters (b,) or (b, …) from values of the rung's parameters."""
        held = self.held.reshape(-1, *[1] * (np.ndim(value) - 1))
        expanded: Array = held + self.M @ value
        return expanded

    def without(self, columns: Sequence[str]) -> Rung:
        """Return the rung with some parameters held at zero."""
        return self._keep([k for k, c in enumerate(self.columns) if c not in set(columns)])

    def _keep(self, kept: list[int]) -> Rung:
        def of(words: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(words[k] for k in kept)

        return replace(
            self,
            columns=of(self.columns),
            labels=of(self.labels),
            units=of(self.units),
            M=self.M[:, kept],
            nonnegative=self.nonnegative[kept],
        )

    def tied(self, name: str, columns: Sequence[str]) -> Rung:
        """Return the rung with some parameters made equal: one column, their sum."""
        at = [self.columns.index(c) for c in columns]
        first, others = at[0], set(at[1:])
        M = self.M.copy()
        M[:, first] = self.M[:, at].sum(1)
        names, labels = list(self.columns), list(self.labels)
        names[first] = name
        labels[first] = " = ".join(self.labels[k] for k in at)
        nonnegative = self.nonnegative.copy()
        nonnegative[first] = self.nonnegative[at].any()
        every = replace(
            self, columns=tuple(names), labels=tuple(labels), M=M, nonnegative=nonnegative
        )
        return every._keep([k for k in range(len(self)) if k not in others])


def full_rung(base: BaseParameters, name: str = "full model", description: str = "") -> Rung:
    """Return the rung of all base parameters."""
    M, held = np.eye(len(base)), np.zeros(len(base))
    return Rung(name, description, base.names, base.labels, base.units, M, held, base.nonnegative)


def build_ladder(entry: LadderEntry, structure: Structure) -> tuple[Rung, ...]:
    """Return the rungs of a ladder over the base parameters of a structure.

    Raises
    ------
    ModelError
        If a rung names a parameter that it does not have.
    """
    rungs: dict[str, Rung] = {}
    before = full_rung(structure.base)
    for item in entry.models:
        if item.name in rungs:
            raise ModelError(f"The ladder has two rungs named '{item.name}'; give each its own.")
        if item.start is not None and item.start not in rungs:
            raise ModelError(
                f"The rung '{item.name}' starts from '{item.start}', which does not stand before "
                f"it{near_match(item.start, rungs)}"
            )
        start = before if item.start is None else rungs[item.start]
        before = rungs[item.name] = _build_rung(item, start, structure)
    return tuple(rungs.values())


def build_comparison(entry: LadderEntry, structure: Structure) -> tuple[Rung, ...]:
    """Return the rungs of a ladder below the unpruned model, which goes first if it is not there.

    Raises
    ------
    ModelError
    """
    rungs = build_ladder(entry, structure)
    if len(rungs[0]) == len(structure.base):
        return rungs
    taken = {rung.name for rung in rungs}
    name = next(n for n in ("full model", "every base parameter", "") if n not in taken)
    return (full_rung(structure.base, name, "every base parameter"), *rungs)


def _build_rung(item: RungEntry, start: Rung, structure: Structure) -> Rung:
    rung = replace(start, name=item.name, description=item.description)
    zero = _find_columns(rung, item.zero, item.name, structure.columns)
    hold: dict[str, float | Literal["nominal"]] = {}
    for text in sorted(item.hold, key=is_pattern, reverse=True):  # a name says more
        hold |= dict.fromkeys(_find_columns(rung, [text], item.name), item.hold[text])
    held = rung.held.copy()
    for name, value in hold.items():
        column = rung.M[:, rung.columns.index(name)]
        row = structure.base.names.index(name)
        at = structure.nominal_base[row] if value == "nominal" else value
        held += column * at
    rung = replace(rung, held=held).without([*zero, *hold])
    for name, texts in item.tie.items():
        members = _find_columns(rung, texts, item.name)
        if len(set(members)) < 2 or (name in rung.columns and name not in members):
            raise ModelError(
                f"The rung '{item.name}' ties '{name}' = {members}; give two or more different "
                "parameters and a name that no other parameter has."
            )
        units = {rung.units[rung.columns.index(m)] for m in members}
        if len(units) > 1:
            raise ModelError(
                f"The rung '{item.name}' ties {listing(members)} of the units "
                f"{listing(sorted(units))}; only parameters of one unit can be equal."
            )
        rung = rung.tied(name, members)
    if item.keep is not None:
        kept = set(_find_columns(rung, item.keep, item.name))
        rung = rung.without([c for c in rung.columns if c not in kept])
    return rung


def _find_columns(
    rung: Rung, texts: Sequence[str], where: str, grouped: Sequence[str] = ()
) -> list[str]:
    """Return the parameters that names and patterns stand for, each once.

    A pattern may fit none but those that are `grouped` into others: at zero they leave these alone.
    """
    found: dict[str, None] = {}
    for name in texts:
        named = find_named(name, rung.columns)
        found |= dict.fromkeys(named)
        if not (named or (is_pattern(name) and find_named(name, grouped))):
            raise ModelError(
                f"The rung '{where}' names the parameter '{name}', which is not there"
                f"{near_match(name, rung.columns)} It has {listing(rung.columns)}."
            )
    return [*found]


def rung_entry(rung: Rung, base: BaseParameters, effects: Sequence[str]) -> RungEntry:
    """Return how a rung stands in a ladder file, reduced from the base parameters in one step."""
    names = base.names
    members = {
        c: [names[k] for k in np.flatnonzero(rung.M[:, i])] for i, c in enumerate(rung.columns)
    }
    gone = [k for k in range(len(base)) if not rung.M[k].any()]
    return RungEntry(
        name=rung.name,
        description=rung.description,
        effects=list(effects),
        zero=[names[k] for k in gone if rung.held[k] == 0],
        hold={names[k]: float(rung.held[k]) for k in gone if rung.held[k] != 0},
        tie={c: m for c, m in members.items() if m != [c]},
    )
