"""A ladder of models: each rung zeroes, ties or keeps base parameters of the one it starts from.

A ladder is a TOML file (every key but ``name`` is optional)::

    [[models]]
    name = "Model 1"
    effects = ["rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia"]

    [[models]]
    name = "Model 2"
    from = "Model 1"                       # default: the rung before
    zero = ["leg1_lower.mx"]               # left out: held at 0
    hold = {"platform.mz" = 0.1}           # held at a value, or at "nominal" (the robot file's)
    tie = {"slider1.Fc" = ["slider1.Fc+", "slider1.Fc-"]}    # columns added: equal values
    keep = ["slider1.Fv"]                  # everything else is left out

Names are those of base parameters (the parameter that represents a group).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from identifiability.documents import read_document
from identifiability.errors import ModelError, listing, near_match
from identifiability.grouping import BaseParameters
from identifiability.information import Information
from identifiability.logs.checks import LARGEST
from identifiability.model import Model
from identifiability.names import Array
from identifiability.options import Expected
from identifiability.robot import Robot

#: The model that a log is analysed with when no ladder is given.
DEFAULT_EFFECTS = ("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia")


def _held(value: Any) -> Any:
    """Refuse what is neither a number nor the word, in one sentence instead of one for each."""
    number = isinstance(value, (int, float)) and abs(value) < LARGEST
    if not number and value != "nominal":
        raise ValueError("give a finite number in SI units, or 'nominal'")
    return value


Held = Annotated[float | Literal["nominal"], BeforeValidator(_held)]


class RungEntry(BaseModel):
    """A rung as it stands in the file."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True, allow_inf_nan=False)

    name: str = Field(min_length=1)
    description: str = ""
    effects: list[str] | None = None
    start: str | None = Field(default=None, alias="from")
    zero: list[str] = []
    hold: dict[str, Held] = {}
    tie: dict[str, list[str]] = {}
    keep: list[str] | None = None


class LadderEntry(BaseModel):
    """The file."""

    model_config = ConfigDict(extra="forbid")

    models: list[RungEntry] = Field(min_length=1)


LadderLike = Annotated[
    LadderEntry | str | Path, Expected("the path of a ladder file or a LadderEntry")
]


@dataclass(frozen=True)
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
        kept = [k for k, c in enumerate(self.columns) if c not in set(columns)]
        return replace(
            self,
            columns=tuple(self.columns[k] for k in kept),
            labels=tuple(self.labels[k] for k in kept),
            units=tuple(self.units[k] for k in kept),
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
        kept = [k for k in range(len(self)) if k not in others]
        return replace(
            self,
            columns=tuple(names[k] for k in kept),
            labels=tuple(labels[k] for k in kept),
            units=tuple(self.units[k] for k in kept),
            M=M[:, kept],
            nonnegative=nonnegative[kept],
        )


def full_rung(base: BaseParameters, name: str = "full model", description: str = "") -> Rung:
    """Return the rung of all base parameters."""
    b = len(base)
    return Rung(
        name, description, base.names, base.labels, base.units, np.eye(b), np.zeros(b),
        base.nonnegative,
    )  # fmt: skip


def default_ladder(robot: Robot) -> LadderEntry:
    """Return the ladder for a robot that has none: asymmetric, then symmetric friction.

    Springs are part of it where the robot file states some.
    """
    springs = any(name.endswith(".K") and value for name, value in robot.nominal.items())
    tie = {f"{joint}.Fc": [f"{joint}.Fc+", f"{joint}.Fc-"] for joint in robot.joints}
    return LadderEntry(
        models=[
            RungEntry(
                name="full model",
                description="every base parameter, friction asymmetric",
                effects=[*DEFAULT_EFFECTS, *(["joint_stiffness"] if springs else [])],
            ),
            RungEntry(
                name="symmetric friction",
                description="one Coulomb level for both directions",
                tie=tie,
            ),
        ]
    )


def ladder_path(robot: Robot) -> Path | None:
    """Return the ladder that stands beside the robot file, if there is one."""
    beside = robot.path.with_name("ladder.toml")
    return beside if beside.is_file() else None


def read_ladder(path: str | Path) -> LadderEntry:
    """Read a ladder file.

    Raises
    ------
    ModelError
        With the file, the key and what was expected.
    """
    return read_document(path, LadderEntry, "TOML", "ladder", ModelError)


def ladder_model(entry: LadderEntry) -> Model:
    """Return the model whose effects the ladder's rungs reduce.

    Raises
    ------
    ModelError
    """
    first = entry.models[0]
    later = [r.name for r in entry.models[1:] if r.effects is not None]
    if later:
        raise ModelError(
            f"The rung '{later[0]}' names effects, but a ladder reduces one model: name all "
            "effects in its first rung and zero or tie what the others leave out."
        )
    return Model.of(*(first.effects if first.effects is not None else DEFAULT_EFFECTS))


def build_ladder(entry: LadderEntry, robot: Robot, base: BaseParameters) -> tuple[Rung, ...]:
    """Return the rungs of a ladder over some base parameters.

    Raises
    ------
    ModelError
        If a rung names a parameter that it does not have.
    """
    rungs: dict[str, Rung] = {}
    before = full_rung(base)
    for item in entry.models:
        if item.name in rungs:
            raise ModelError(f"The ladder has two rungs named '{item.name}'; give each its own.")
        if item.start is not None and item.start not in rungs:
            raise ModelError(
                f"The rung '{item.name}' starts from '{item.start}', which does not stand before "
                f"it{near_match(item.start, rungs)}"
            )
        start = before if item.start is None else rungs[item.start]
        before = rungs[item.name] = _build_rung(item, start, robot, base)
    return tuple(rungs.values())


def _build_rung(item: RungEntry, start: Rung, robot: Robot, base: BaseParameters) -> Rung:
    rung = replace(start, name=item.name, description=item.description)
    _check_columns(rung, [*item.zero, *item.hold], item.name)
    held = rung.held.copy()
    for name, value in item.hold.items():
        column = rung.M[:, rung.columns.index(name)]
        at = _nominal_value(robot, base, name) if value == "nominal" else value
        held += column * at
    rung = replace(rung, held=held).without([*item.zero, *item.hold])
    for name, members in item.tie.items():
        _check_columns(rung, members, item.name)
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
        _check_columns(rung, item.keep, item.name)
        rung = rung.without([c for c in rung.columns if c not in set(item.keep)])
    return rung


def _nominal_value(robot: Robot, base: BaseParameters, name: str) -> float:
    row = base.names.index(name)
    return float(sum(c * robot.nominal.get(p.name, 0.0) for c, p in base.terms(row)))


def _check_columns(rung: Rung, names: Sequence[str], where: str) -> None:
    for name in names:
        if name not in rung.columns:
            raise ModelError(
                f"The rung '{where}' names the parameter '{name}', which is not there"
                f"{near_match(name, rung.columns)} It has {listing(rung.columns)}."
            )


def nominal_base(robot: Robot, base: BaseParameters) -> Array:
    """Return the values that the robot file states for the base parameters, (b,)."""
    phi = np.array([robot.nominal.get(p.name, 0.0) for p in base.parameters])
    values: Array = base.G @ phi
    return values
