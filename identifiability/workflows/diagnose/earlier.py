"""`Earlier`: a diagnosis that is gone on from, with a log more: what was open is decided.

The names that it settled begin the search and are tested like all others: they go where they help
no longer. Of an "A or B" the one that explains most of all logs together begins it. Functions
without a name begin the last pass, once names were looked for again. The logs that it was made from
are looked for where its file is, and beside the logs that are given.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from identifiability.effects import Placed, title_of
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import IdentifiabilityError, LogError, listing
from identifiability.foundation.options import Expected
from identifiability.foundation.values import frozen
from identifiability.logs.formats.bags import hash_files
from identifiability.robot import Robot
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Outcome, Turn
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.motion import PART
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.search import Search
from identifiability.workflows.predict import Entry

#: How a diagnosis that is gone on from is given.
Before = Annotated[Findings | str | Path, Expected("a result of diagnose, or the path of its JSON")]


class PlaceEntry(Entry):
    """A named effect at a place."""

    joint: str
    p_value: float
    parameters: dict[str, float]


class EffectEntry(Entry):
    """A named effect."""

    effect: str
    unnamed: bool = False
    alternatives: list[str] = Field(default=[], alias="or")
    places: list[PlaceEntry]


class RolesEntry(Entry):
    """What logs were for."""

    fitted: list[str]
    verified_logs: list[str]


class AfterEntry(Entry):
    """The error with what was named."""

    error_ra_validation: float


class DiagnosisEntry(Entry):
    """The part of a diagnosis that is gone on from."""

    model: list[str]
    effects: list[EffectEntry]
    roles: RolesEntry
    after: AfterEntry
    provenance: dict[str, str]


@frozen
class Told:
    """A name at a place that the earlier diagnosis gave.

    Attributes
    ----------
    name, place : str
    parameters : tuple of str
    alternatives : tuple of str
        Other families that it could not be told from.
    p_value : float
    unnamed : bool
        Whether it is a function without a name.
    """

    name: str
    place: str
    parameters: tuple[str, ...]
    alternatives: tuple[str, ...]
    p_value: float
    unnamed: bool = False

    @property
    def names(self) -> str:
        """The name, with its alternatives, in words."""
        return " or ".join(map(title_of, (self.name, *self.alternatives)))


@frozen
class Earlier:
    """A diagnosis that is gone on from.

    Attributes
    ----------
    source : str
        What to call it.
    folder : Path or None
        Where its file is.
    model : tuple of str
        Effects that were diagnosed.
    told : tuple of Told
    error : float
        ε_RA on the motion that verified it, with these.
    fitted, verified : tuple of str
        Names of its logs.
    hashes : mapping of str to str
        SHA-256 of each log.
    """

    source: str
    folder: Path | None
    model: tuple[str, ...]
    told: tuple[Told, ...]
    error: float
    fitted: tuple[str, ...]
    verified: tuple[str, ...]
    hashes: Mapping[str, str]

    @property
    def families(self) -> tuple[str, ...]:
        """Families that it named, or could not tell from those, and functions."""
        every = (n for t in self.told for n in (t.name, *t.alternatives))
        return tuple(dict.fromkeys(every))

    def start(self, search: Search) -> Hypothesis:
        """Return the hypothesis that the search begins with, settled names first."""
        p = search.problem
        begun = Hypothesis()
        for t in sorted(self.told, key=lambda t: (t.unnamed, bool(t.alternatives))):
            view = p.settled(begun.parts)
            taken = {p.candidates[k].slot for k in begun.parts}
            gains = search.gains(begun.parts, view)
            options = [
                k
                for k, c in enumerate(p.candidates)
                if c.place == t.place and c.slot not in taken and np.isfinite(gains[k])
                and self._is_told(p.setting.structure.robot, c, t)
            ]  # fmt: skip
            if options:
                begun = begun.add(max(options, key=lambda k: gains[k]), 0.0)
        return begun

    @staticmethod
    def _is_told(robot: Robot, c: Candidate, t: Told) -> bool:
        """Whether a candidate is what was told: the same parameters, or an alternative."""
        if c.family.name in t.alternatives:
            return True
        own = Placed.part_parameters(robot, c.part)
        return c.family.name == t.name and tuple(p.name for p in own) == t.parameters

    def turns(self, found: Findings) -> tuple[Turn, ...]:
        """Return what became of each name."""
        return tuple(_turn(t, found.effects, self.told) for t in self.told)

    def find_logs(
        self, logs: Sequence[Any], held_out: Sequence[Any]
    ) -> tuple[list[Any], list[Any]]:
        """Return the logs that are fitted and held out: its own, and those that are given.

        Raises
        ------
        LogError
            If one of its own is nowhere, or nothing is left that verifies.
        """
        given = {_name(x) for x in (*logs, *held_out)}
        folders = [self.folder, *(Path(x).parent for x in logs if isinstance(x, str | Path))]
        fitted, verified = (
            list(dict.fromkeys(n.partition(PART)[0] for n in names))
            for names in (self.fitted, self.verified)
        )
        apart = [name for name in verified if name not in fitted]
        if not (held_out or apart):
            raise LogError(
                f"{self.source} was verified on a part of {listing(verified)}, which is fitted as a"
                " whole with a log more; give a log that verifies (--validate)."
            )
        own = [self._find(name, folders) for name in fitted if name not in given]
        unseen = [self._find(name, folders) for name in apart if name not in given]
        return [*own, *logs], [*unseen, *held_out]

    def _find(self, name: str, folders: Iterable[Path | None]) -> Path:
        digests = {d for n, d in self.hashes.items() if n.partition(PART)[0] == name}
        for folder in dict.fromkeys(f for f in folders if f is not None):
            path = folder / name
            if path.is_file() and hash_files(path) in digests:
                return path
        raise LogError(
            f"{self.source} was made from {name}, which is neither beside it nor beside the logs "
            "given, or has changed; give it too."
        )


def read_earlier(given: Before) -> Earlier:
    """Return the diagnosis that is gone on from: a result, or the path of its JSON.

    Raises
    ------
    IdentifiabilityError
        If it is none.
    """
    if isinstance(given, Findings):
        return Earlier(
            source="the diagnosis before",
            folder=None,
            model=given.structure.model.texts,
            told=tuple(t for e in given.effects for t in _tell(e)),
            error=given.held_after,
            fitted=tuple(s.name for s in given.samples),
            verified=tuple(s.name for s in given.validation),
            hashes={s.name: s.sha256 for s in (*given.samples, *given.validation)},
        )
    path = Path(given)
    content = read_document(
        path, DiagnosisEntry, "JSON", "result of diagnose", IdentifiabilityError
    )
    return Earlier(
        source=path.name,
        folder=path.parent,
        model=tuple(content.model),
        told=tuple(
            Told(
                e.effect, p.joint, tuple(p.parameters), tuple(e.alternatives), p.p_value, e.unnamed
            )
            for e in content.effects
            for p in e.places
        ),
        error=content.after.error_ra_validation,
        fitted=tuple(content.roles.fitted),
        verified=tuple(content.roles.verified_logs),
        hashes={
            key.removeprefix("sha256 "): digest
            for key, digest in content.provenance.items()
            if key.startswith("sha256 ")
        },
    )


def _tell(e: NamedEffect) -> list[Told]:
    return [
        Told(e.name, p.place, p.parameters, e.alternatives, p.p_value, e.unnamed)
        for p in e.placements
    ]


def _turn(t: Told, effects: Sequence[NamedEffect], told: Sequence[Told]) -> Turn:
    before = f"{t.names} in {t.place}"
    named = {t.name, *t.alternatives}
    now = [e for e in effects if e.name in named and t.place in e.joints]
    if not now and t.unnamed:  # a name that was not there before is what the function was
        known = {name for other in told for name in (other.name, *other.alternatives)}
        now = [e for e in effects if t.place in e.joints and e.name not in known]
        if now:
            return Turn(before, now[0].names, "decided")
    if not now:
        return Turn(before, "", "gone")
    outcome: Outcome = "open" if now[0].alternatives else "decided" if t.alternatives else "kept"
    return Turn(before, now[0].names, outcome)


def _name(log: Any) -> str:
    return Path(log).name if isinstance(log, str | Path) else getattr(log, "name", "")
