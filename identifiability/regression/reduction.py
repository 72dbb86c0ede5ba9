"""Ladders of models: files in, models (`Submodel`) over base parameters out.

Each model zeroes, ties or keeps base parameters of the one it starts from. Names are those of base
parameters (the parameter that represents a group); in every list and in ``hold`` a pattern means
all names that fit it (``leg*_lower.Ixx``; ``*`` is any letters, ``?`` one). A model file
(``model.toml``) is a ladder of one model. ``docs/reference/ladders.md`` is written from the keys.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, runtime_checkable

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat

from identifiability.effects import FAMILIES, default_effects
from identifiability.effects.measurement import TorqueOffset
from identifiability.foundation.documents import key, read_document
from identifiability.foundation.errors import ModelError, listing, near_match
from identifiability.foundation.linalg import ROUNDOFF, or_one
from identifiability.foundation.names import Array, Strings, find_named, is_pattern, specificity
from identifiability.foundation.options import Expected
from identifiability.foundation.quoting import for_toml, toml_comment
from identifiability.foundation.values import Fields, frozen
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.robot import Robot

from .information import Information
from .regression import Model
from .structure import BaseParameters, Structure

#: The model of those that judge one alone: no torque offset, so that one can be named, or asked
#: for by a motion.
USUAL_EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")

#: The model that a log is analysed with when no ladder is given. An offset and one Coulomb level
#: span two levels, and no sign is forbidden where a sensor is off by more than friction.
DEFAULT_EFFECTS = (*USUAL_EFFECTS, "torque_offset")


def _held(value: Any) -> Any:
    """Refuse any value that is neither a number nor "nominal", with one message."""
    number = isinstance(value, (int, float)) and abs(value) < LOG_RULES.largest
    if not number and value != "nominal":
        raise ValueError("give a finite number in SI units, or 'nominal'")
    return value


FixedValue = Annotated[float | Literal["nominal"], BeforeValidator(_held)]


class ModelEntry(BaseModel):
    """A model."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True, allow_inf_nan=False)

    name: str = key("Its name.", min_length=1)
    description: str = key("A sentence on it.", "")
    effects: list[str] | None = key(
        "Effects that make its torque, for the first model: an effect everywhere, in some joints "
        "(`@slider1+slider2`, `@leg*`), with its shape behind a colon.",
        None,
        ["rigid_body", "viscous_friction", "stribeck_friction@slider1:0.02"],
    )
    start: str | None = key(
        "That it starts from; else the one before.", None, "Model 1", alias="from"
    )
    zero: list[str] = key("Left out: held at 0.", [], ["leg1_lower.mx"])
    hold: dict[str, FixedValue] = key(
        "Held at [SI], or as nominal.", {}, {"platform.mz": "nominal"}
    )
    tie: dict[str, list[str]] = key(
        "Equal values.", {}, {"slider1.Fc": ["slider1.Fc+", "slider1.Fc-"]}
    )
    keep: list[str] | None = key("Everything else is left out.", None, ["slider1.Fv"])
    random: dict[str, PositiveFloat] = key(
        "Random effects, for the first model: the standard deviation of values about zero [SI].",
        {},
        {"slider1.v1": 2.5},
    )
    refuted: list[str] = key(
        "Effects that `diagnose` left out there, because held-out motion contradicts them.",
        [],
        ["hysteresis@slider1"],
    )


class LadderEntry(BaseModel):
    """The file."""

    model_config = ConfigDict(extra="forbid")

    models: list[ModelEntry] = Field(min_length=1)


@runtime_checkable
class HasLadder(Protocol):
    """A result that contains a model, such as that of `prune`."""

    def to_ladder(self) -> LadderEntry:
        """Return the model as a ladder of one model."""


LadderLike = Annotated[
    LadderEntry | HasLadder | str | Path,
    Expected("the path of a ladder file, a LadderEntry or the result of prune"),
]


#: A single model: for verbs that do not compare several.
ModelLike = Annotated[
    Model | HasLadder | Path | str | Sequence[str],
    Expected("a Model, a list of effects, the path of a model file or the result of prune"),
]


@frozen
class LadderSource:
    """A ladder and where it came from.

    Attributes
    ----------
    entry : LadderEntry
    origin : str
        The name of its file (reports tell no paths of a machine), or what it is.
    sha256 : str
        Hash of the file, or of its content where there is none.
    """

    entry: LadderEntry
    origin: str
    sha256: str

    def models_for(self, commanded: bool) -> LadderEntry:
        """Return the models to compare: of commanded robots a default one has torque offsets.

        Zeros of commands and encoders differ by milliradians, and a servo makes torque of that; a
        model without offsets predicts torque as well and puts them into masses and rotors.
        """
        default = self.origin == "default" and commanded
        if default:
            return LadderEntry(models=self.entry.models[:1])
        return self.entry


def find_ladder(
    robot: Robot, ladder: LadderEntry | HasLadder | str | Path | None, beside: bool
) -> LadderSource:
    """Return the ladder that is meant.

    Parameters
    ----------
    robot : Robot
    ladder : LadderEntry, path, result of `prune`, or None
    beside : bool
        Whether none means that which lies beside the robot file.

    Raises
    ------
    ModelError
    """
    found = ladder_path(robot) if ladder is None and beside else ladder
    if isinstance(found, (str, Path)):
        entry = read_ladder(found)
        origin = str(found) if ladder is not None else Path(found).name
        digest = hashlib.sha256(Path(found).read_bytes())
        return LadderSource(entry, origin, digest.hexdigest())
    if found is None:
        entry = default_ladder(robot)
        origin = "default"
    elif isinstance(found, LadderEntry):
        entry = found
        origin = "given as a LadderEntry"
    else:
        entry = found.to_ladder()
        origin = "given as a result"
    digest = hashlib.sha256(ladder_text(entry).encode())
    return LadderSource(entry, origin, digest.hexdigest())


def choose_model(model: ModelLike | None, default: Sequence[str]) -> Model:
    """Return the model that is meant, with all parameters of its effects.

    Parameters
    ----------
    model : Model, names of effects, path of a model file, result of `prune`, or None
    default : sequence of str
        Effects for None.

    Raises
    ------
    ModelError
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, (HasLadder, str, Path)):
        return ladder_model(_ladder_of(model))
    return Model.of(*(default if model is None else model))


def _ladder_of(model: HasLadder | str | Path) -> LadderEntry:
    if isinstance(model, (str, Path)):
        return read_ladder(model)
    return model.to_ladder()


def free_again(model: ModelLike | None) -> Strings:
    """Return the sentence that a model file's reductions were not used, if it has any."""
    submodels = _ladder_of(model).models if isinstance(model, (HasLadder, str, Path)) else []
    if len(submodels) <= 1 and not any((r.zero or r.hold or r.tie or r.keep) for r in submodels):
        return ()
    return (
        "Of the model file only the effects were used: parameters that its models leave out, "
        "hold or tie are free here.",
    )


def ladder_text(entry: LadderEntry, comment: str = "") -> str:
    """Return a ladder as the text of its file."""
    lines = [toml_comment(comment)] if comment else []
    for submodel in entry.models:
        given = submodel.model_dump(by_alias=True, exclude_defaults=True)
        tables = {k: given.pop(k) for k in ("hold", "tie", "random") if k in given}
        lines += ["", "[[models]]", *(f"{k} = {for_toml(v)}" for k, v in given.items())]
        for name, table in tables.items():
            lines.append(f"[models.{name}]")
            lines += [f"{for_toml(k)} = {for_toml(v)}" for k, v in table.items()]
    return "\n".join(lines).lstrip("\n") + "\n"


def default_ladder(robot: Robot) -> LadderEntry:
    """Return the ladder for a robot that has none: with torque offsets, if any, then without.

    Springs are part of it where the robot file states some. A body alone has no joints to rub.
    """
    joints = bool(robot.motor_joints)
    effects = default_effects(robot, DEFAULT_EFFECTS if joints else ["rigid_body"])
    said = "every base parameter, with torque offsets" if joints else "the body"
    full = ModelEntry(name="full model", description=said, effects=[*effects])
    said = "no constant torque in any joint"
    bare = ModelEntry(name="without torque offset", description=said, zero=["*.off"])
    offsets = any(text.partition("@")[0] == TorqueOffset.name for text in effects)
    return LadderEntry(models=[full, bare] if offsets else [full])


def ladder_path(robot: Robot) -> Path | None:
    """Return the path of the ladder in the folder of the robot file, if there is one."""
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
    """Return the model whose effects the ladder's models reduce.

    Raises
    ------
    ModelError
    """
    first = entry.models[0]
    later = [r.name for r in entry.models[1:] if r.effects is not None]
    if later:
        raise ModelError(
            f"The model '{later[0]}' names effects, but a ladder reduces one model: name all "
            "effects in its first model and zero or tie the parameters that the others leave out."
        )
    model = Model.of(*(first.effects if first.effects is not None else DEFAULT_EFFECTS))
    return replace(model, random=first.random)


# `Submodel`: one model of a ladder over base parameters, as columns and a held torque.


@frozen
class Submodel:
    """One model of a ladder: columns ``W_base M`` and torque ``τ - W_base fixed``.

    Attributes
    ----------
    name, description : str
    columns, labels, units : tuple of str
        Of its m parameters.
    M : (b, m)
        Base parameters from the model's: ``beta = fixed + M x``.
    fixed : (b,)
        Values of base parameters that are held.
    nonnegative : (m,) bool
        Whether physics forbids a value below zero.
    """

    name: str
    description: str
    columns: Strings
    labels: Strings
    units: Strings
    M: Array
    fixed: Array
    nonnegative: np.ndarray

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.columns)

    @cached_property
    def inverse(self) -> Array:
        """Pseudoinverse of M, (m, b)."""
        return np.linalg.pinv(self.M)

    def reduce(self, information: Information) -> Information:
        """Return the information about the model's parameters."""
        return information.reduce(self.M, self.columns, self.fixed)

    def expand(self, value: Array) -> Array:
        """Return base parameters (b,) or (b, …) from values of the model's parameters."""
        fixed = self.fixed.reshape(-1, *[1] * (np.ndim(value) - 1))
        return fixed + self.M @ value

    def without(self, columns: Sequence[str]) -> Submodel:
        """Return the model with some parameters held at zero."""
        return self._keep([k for k, c in enumerate(self.columns) if c not in set(columns)])

    def _keep(self, kept: list[int]) -> Submodel:
        words = ("columns", "labels", "units")
        own: Fields = {w: tuple(getattr(self, w)[k] for k in kept) for w in words}
        return replace(self, **own, M=self.M[:, kept], nonnegative=self.nonnegative[kept])

    def ordered(self, columns: Sequence[str]) -> Submodel:
        """Return the model with its parameters in another order."""
        return self._keep([self.columns.index(name) for name in columns])

    def tied(self, name: str, columns: Sequence[str]) -> Submodel:
        """Return the model with some parameters made equal: one column, their sum."""
        at = [self.columns.index(c) for c in columns]
        first = at[0]
        others = set(at[1:])
        M = self.M.copy()
        M[:, first] = self.M[:, at].sum(1)
        names = list(self.columns)
        labels = list(self.labels)
        names[first] = name
        labels[first] = " = ".join(self.labels[k] for k in at)
        nonnegative = self.nonnegative.copy()
        nonnegative[first] = self.nonnegative[at].any()
        every = replace(
            self, columns=tuple(names), labels=tuple(labels), M=M, nonnegative=nonnegative
        )
        return every._keep([k for k in range(len(self)) if k not in others])


def full_model(base: BaseParameters, name: str = "full model", description: str = "") -> Submodel:
    """Return the model of all base parameters."""
    M = np.eye(len(base))
    fixed = np.zeros(len(base))
    return Submodel(
        name, description, base.names, base.labels, base.units, M, fixed, base.nonnegative
    )


def build_ladder(entry: LadderEntry, structure: Structure) -> tuple[Submodel, ...]:
    """Return the models of a ladder over the base parameters of a structure.

    Raises
    ------
    ModelError
        If a model names a parameter that it does not have.
    """
    submodels: dict[str, Submodel] = {}
    before = full_model(structure.base)
    for item in entry.models:
        if item.name in submodels:
            raise ModelError(
                f"The ladder has two models named '{item.name}'; give each its own name."
            )
        if item.start is not None and item.start not in submodels:
            raise ModelError(
                f"The model '{item.name}' starts from '{item.start}', which does not stand before "
                f"it{near_match(item.start, submodels)}"
            )
        start = before if item.start is None else submodels[item.start]
        before = submodels[item.name] = _build_submodel(item, start, structure)
    return tuple(submodels.values())


def build_comparison(entry: LadderEntry, structure: Structure) -> tuple[Submodel, ...]:
    """Return the models of a ladder below the unpruned model.

    The unpruned model is added if it is absent.

    Raises
    ------
    ModelError
    """
    submodels = build_ladder(entry, structure)
    if len(submodels[0]) == len(structure.base):
        return submodels
    taken = {submodel.name for submodel in submodels}
    name = next(n for n in ("full model", "every base parameter", "") if n not in taken)
    return (full_model(structure.base, name, "every base parameter"), *submodels)


def compare_models(entry: LadderEntry | None, structure: Structure) -> tuple[Submodel, ...]:
    """Return the models of a ladder, or the full model where the ladder is of other parameters."""
    with suppress(ModelError):
        if entry is not None:
            return build_comparison(entry, structure)
    return (full_model(structure.base),)


def _build_submodel(item: ModelEntry, start: Submodel, structure: Structure) -> Submodel:
    submodel = replace(start, name=item.name, description=item.description)
    base = structure.base
    zero = _find_columns(submodel, item.zero, item.name, base, structure.columns)
    hold: dict[str, float | Literal["nominal"]] = {}
    for text in sorted(item.hold, key=specificity):  # a name says more
        hold |= dict.fromkeys(_find_columns(submodel, [text], item.name, base), item.hold[text])
    fixed = submodel.fixed.copy()
    for name, value in hold.items():
        column = submodel.M[:, submodel.columns.index(name)]
        row = base.names.index(name)
        at = structure.nominal_base[row] if value == "nominal" else value
        fixed += column * at
    submodel = replace(submodel, fixed=fixed).without([*zero, *hold])
    for name, texts in item.tie.items():
        members = _find_columns(submodel, texts, item.name, base)
        if len(set(members)) < 2 or (name in submodel.columns and name not in members):
            raise ModelError(
                f"The model '{item.name}' ties '{name}' = {members}; give two or more different "
                "parameters and a name that no other parameter has."
            )
        units = {submodel.units[submodel.columns.index(m)] for m in members}
        if len(units) > 1:
            raise ModelError(
                f"The model '{item.name}' ties {listing(members)} of the units "
                f"{listing(sorted(units))}; only parameters of one unit can be equal."
            )
        submodel = submodel.tied(name, members)
    if item.keep is not None:
        kept = set(_find_columns(submodel, item.keep, item.name, base))
        submodel = submodel.without([c for c in submodel.columns if c not in kept])
    return submodel


def _find_columns(
    submodel: Submodel,
    texts: Sequence[str],
    where: str,
    base: BaseParameters,
    grouped: Sequence[str] = (),
) -> list[str]:
    """Return the parameters that names and patterns match, each once.

    A pattern may fit only parameters that are `grouped` into others: at zero they leave these
    alone.
    """
    found: dict[str, None] = {}
    for name in texts:
        named = find_named(name, submodel.columns)
        found |= dict.fromkeys(named)
        if not (named or (is_pattern(name) and find_named(name, grouped))):
            absence = base.explain_absence(name)
            reason = f": {absence}" if absence else near_match(name, submodel.columns)
            raise ModelError(
                f"The model '{where}' names the parameter '{name}', which is not there{reason} "
                f"It has {listing(submodel.columns, things='parameters')}."
            )
    return [*found]


def model_entry(submodel: Submodel, structure: Structure) -> ModelEntry:
    """Return a model's entry in a ladder file, reduced from the base parameters in one step."""
    base = structure.base
    model = structure.model
    names = base.names
    members = {
        c: [names[k] for k in np.flatnonzero(submodel.M[:, i])]
        for i, c in enumerate(submodel.columns)
    }
    gone = [k for k in range(len(base)) if not submodel.M[k].any()]
    fixed = {names[k]: float(submodel.fixed[k]) for k in gone}
    zero = [name for name, value in fixed.items() if value == 0]
    tie = {c: m for c, m in members.items() if m != [c]}
    return ModelEntry(
        name=submodel.name,
        description=submodel.description,
        effects=list(model.texts),
        random=dict(model.random),
        zero=zero,
        hold={name: value for name, value in fixed.items() if value != 0},
        tie=tie,
    )


# Learned functions that contain terms of the model.
#
# Splines over the velocity of a joint contain its viscous and Coulomb friction, splines over its
# position a spring: data never determine the shares of both. The code below gives the terms all
# that they can explain, and the function, orthogonal to them on the data, the rest: the terms mean
# what they mean in a model without the function, and a robot file, which holds terms and no
# functions, holds as much as it can.


def list_functions(structure: Structure) -> list[np.ndarray]:
    """Return the columns of every function of a model, (k,) int each."""
    groups: dict[tuple[str, str], list[int]] = {}
    for k, p in enumerate(structure.parameters):
        if p.group in FAMILIES and FAMILIES[p.group].flexible:
            groups.setdefault((p.group, p.owner), []).append(k)
    return [np.array(columns) for columns in groups.values()]


def leave_to_terms(structure: Structure, R: Array, phi: Array) -> Array:
    """Return standard parameters (p,) of the same torque, with functions as small as possible.

    Parameters
    ----------
    structure : Structure
    R : (r, p)
        Rows whose norms are those of torque on the data.
    phi : (p,)

    Returns
    -------
    (p,)
        ``R phi`` is the same, what a function adds to it is orthogonal to the terms at its place
        that it contains, unless one would have a sign that physics forbids, and splines where no
        data are have no values.
    """
    out = phi.copy()
    for own, terms, P in _contained(structure, R):
        least = np.where(structure.nonnegative[terms], -out[terms], -np.inf)
        length = np.linalg.norm(R[:, terms], axis=0)
        unit = R[:, terms] / length
        moved = R[:, own] @ out[own]
        free = np.linalg.lstsq(unit, moved, rcond=None)[0]
        share = np.maximum(free / length, least)
        out[own] -= P @ share
        out[terms] += share
        nothing = ~R[:, own].any(axis=0)
        out[own[nothing]] = 0.0
    return out


def _contained(structure: Structure, R: Array) -> Iterator[tuple[np.ndarray, np.ndarray, Array]]:
    """Yield each function (k,), the terms (t,) that it contains, and these by its values (k, t)."""
    functions = list_functions(structure)
    every = structure.parameters
    flexible = np.isin(np.arange(len(every)), np.concatenate([*functions, []]))
    length = np.linalg.norm(R, axis=0)
    unit = R / or_one(length)
    for own in functions:
        here = np.array([p.owner == every[own[0]].owner for p in every])
        terms = np.flatnonzero(here & ~flexible & (length > 0))
        acts = length[own] > 0
        P = np.zeros((len(own), len(terms)))
        own_unit = unit[:, own[acts]]
        P[acts] = np.linalg.lstsq(own_unit, unit[:, terms], rcond=1e-12)[0]
        inside = np.linalg.norm(unit[:, own] @ P - unit[:, terms], axis=0) < ROUNDOFF
        P[acts] *= length[terms] / length[own[acts], None]
        yield own, terms[inside], P[:, inside]
