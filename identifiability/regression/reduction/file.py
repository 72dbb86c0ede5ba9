"""A ladder of models: each rung zeroes, ties or keeps base parameters of the one it starts from.

A ladder is a TOML file (every key but ``name`` is optional)::

    [[models]]
    name = "Model 1"
    effects = ["rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia",
        "joint_stiffness@slider1+slider2",     # in these joints only
        "quadratic_friction@leg*",             # … in all whose names fit
        "stribeck_friction@slider1:0.02"]      # … with its shape, the Stribeck velocity

    [[models]]
    name = "Model 2"
    from = "Model 1"                       # default: the rung before
    zero = ["leg1_lower.mx"]               # left out: held at 0
    hold = {"platform.mz" = 0.1}           # held at a value, or at "nominal" (the robot file's)
    tie = {"slider1.Fc" = ["slider1.Fc+", "slider1.Fc-"]}    # columns added: equal values
    keep = ["slider1.Fv"]                  # everything else is left out

Names are those of base parameters (the parameter that represents a group); in every list and in
``hold`` a pattern stands for all that fit it (``leg*_lower.Ixx``; ``*`` is any letters, ``?`` one).
A model file
(``model.toml``) is a ladder of one rung.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, runtime_checkable

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from identifiability.effects import default_effects
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import ModelError
from identifiability.foundation.options import Expected
from identifiability.foundation.values import frozen
from identifiability.logs.checks import LARGEST
from identifiability.regression.model import Model
from identifiability.robot import Robot

#: The model of those that judge one alone: no torque offset, so that one can be named, or asked
#: for by a motion.
USUAL_EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")

#: The model that a log is analysed with when no ladder is given. An offset and one Coulomb level
#: span what two levels do, and no sign is forbidden where a sensor is off by more than friction.
DEFAULT_EFFECTS = (*USUAL_EFFECTS, "torque_offset")


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


@runtime_checkable
class HasLadder(Protocol):
    """A result that is a model, such as that of `prune`."""

    def to_ladder(self) -> LadderEntry:
        """Return the model as a ladder of one rung."""


LadderLike = Annotated[
    LadderEntry | HasLadder | str | Path,
    Expected("the path of a ladder file, a LadderEntry or the result of prune"),
]


#: What one model is: for verbs that do not compare several.
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


def find_ladder(
    robot: Robot, ladder: LadderEntry | HasLadder | str | Path | None, *, beside: bool
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
        return LadderSource(
            entry, Path(found).name, hashlib.sha256(Path(found).read_bytes()).hexdigest()
        )
    if found is None:
        entry, origin = default_ladder(robot), "default"
    elif isinstance(found, LadderEntry):
        entry, origin = found, "given as a LadderEntry"
    else:
        entry, origin = found.to_ladder(), "given as a result"
    return LadderSource(entry, origin, hashlib.sha256(ladder_text(entry).encode()).hexdigest())


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
    return read_ladder(model) if isinstance(model, (str, Path)) else model.to_ladder()


def free_again(model: ModelLike | None) -> tuple[str, ...]:
    """Return the sentence that a model file's reductions were not used, if it has any."""
    rungs = _ladder_of(model).models if isinstance(model, (HasLadder, str, Path)) else []
    if len(rungs) <= 1 and not any((r.zero or r.hold or r.tie or r.keep) for r in rungs):
        return ()
    return (
        "Of the model file only the effects were used: what its models leave out, hold or tie is "
        "free here.",
    )


def unused_ladder(robot: Robot, given: object = None) -> tuple[str, ...]:
    """Return the sentence that a ladder beside the robot was not used, if one was not."""
    path = ladder_path(robot) if given is None else None
    if path is None:
        return ()
    return (
        f"{path.name} beside {robot.path.name} was not used: by default only analyze and calibrate "
        "judge the models of a ladder.",
    )


def ladder_text(entry: LadderEntry, comment: str = "") -> str:
    """Return a ladder as the text of its file."""
    lines = [f"# {comment}"] if comment else []
    for rung in entry.models:
        given = rung.model_dump(by_alias=True, exclude_defaults=True)
        tables = {k: given.pop(k) for k in ("hold", "tie") if k in given}
        lines += ["", "[[models]]", *(f"{k} = {_toml(v)}" for k, v in given.items())]
        for name, table in tables.items():
            lines += [f"[models.{name}]", *(f"{_toml(k)} = {_toml(v)}" for k, v in table.items())]
    return "\n".join(lines).lstrip("\n") + "\n"


def _toml(value: str | float | list[str]) -> str:
    """Return a value in TOML, whose strings, numbers and lists of strings are those of JSON."""
    return json.dumps(value, ensure_ascii=False)


def default_ladder(robot: Robot) -> LadderEntry:
    """Return the ladder for a robot that has none: with torque offsets, then without.

    Springs are part of it where the robot file states some.
    """
    return LadderEntry(
        models=[
            RungEntry(
                name="full model",
                description="every base parameter, with torque offsets",
                effects=[*default_effects(robot, DEFAULT_EFFECTS)],
            ),
            RungEntry(
                name="no torque offset",
                description="torque is zero where nothing acts",
                zero=["*.off"],
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
