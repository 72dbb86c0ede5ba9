"""The sidecar: a TOML file beside the robot file with what the robot file cannot say.

Every key is optional::

    name = "3-RPS parallel robot"
    actuated = ["joint1", "joint2"]      # URDF: which joints have a motor (default: all)
    inertia_parts = ["Jr", "Js"]         # what an actuator's inertia is made of (default: Ia)

    [home]                               # joint = position; selects the assembly of a closed chain
    joint1 = 0.3

    [[loops]]                            # point closures, in the frames of the bodies
    name = "tip"
    body1 = "left_tip"
    point1 = [0.3, 0, 0]
    body2 = "right_tip"
    point2 = [0.3, 0, 0]
    axes = ["x", "z"]                    # world directions in which it is demanded (default: all)

    [[couplings]]                        # joint = c0 + c1 of + c2 of² + …
    joint = "joint3"
    of = "joint2"
    polynomial = [0, -1]

    [transmission]                       # motor = ratio ∘ (coupling · (q - offset))
    motors = ["m1", "m2"]
    coupling = [[1, 0], [1, 1]]
    ratio = [45, 32]
    offset = [0, 0]

    [symbols]                            # short forms in labels: body or joint = symbol
    platform = "3"

    [base_parameters]
    bodies = ["arm2", "arm1"]            # whose columns are kept first when columns are grouped

    [nominal]                            # parameter values beside those of the robot file
    "joint1.Fv" = 3.0

    [limits]                             # actuated joint = {q = [lo, hi], v = vmax, a = amax}
    joint1 = {q = [-1, 1], v = 2, a = 10}

    [[symmetry]]                         # columns that equal legs let us add
    name = "equal legs"
    tie = {"leg.my" = ["leg1.my", "leg2.my"]}
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identifiability.errors import RobotError

Triple = tuple[float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class LoopEntry(_Strict):
    """A point closure."""

    name: str = ""
    body1: str
    point1: Triple = (0.0, 0.0, 0.0)
    body2: str
    point2: Triple = (0.0, 0.0, 0.0)
    axes: list[Literal["x", "y", "z"]] = Field(default=["x", "y", "z"], min_length=1)


class CouplingEntry(_Strict):
    """A joint coupling."""

    name: str = ""
    joint: str
    of: str | None = None
    polynomial: list[float] = Field(default=[0.0, 1.0], min_length=1)


class TransmissionEntry(_Strict):
    """Motors that mix joints."""

    motors: list[str]
    coupling: list[list[float]]
    ratio: list[float] | None = None
    offset: list[float] | None = None


class BaseParametersEntry(_Strict):
    """Preference of the grouping."""

    bodies: list[str] = []


class LimitEntry(_Strict):
    """Motion limits of an actuated joint."""

    q: tuple[float, float] | None = None
    v: float | None = Field(default=None, gt=0)
    a: float | None = Field(default=None, gt=0)


class SymmetryEntry(_Strict):
    """Columns that a symmetry lets us add."""

    name: str = ""
    tie: dict[str, list[str]]


class Sidecar(_Strict):
    """The whole file."""

    name: str = ""
    description: str = ""
    actuated: list[str] | None = None
    inertia_parts: list[str] = ["Ia"]
    home: dict[str, float] = {}
    loops: list[LoopEntry] | None = None
    couplings: list[CouplingEntry] = []
    transmission: TransmissionEntry | None = None
    symbols: dict[str, str] = {}
    base_parameters: BaseParametersEntry = BaseParametersEntry()
    nominal: dict[str, float] = {}
    limits: dict[str, LimitEntry] = {}
    symmetry: list[SymmetryEntry] = []


def read_sidecar(path: Path | None) -> Sidecar:
    """Read a sidecar; no path gives an empty one.

    Raises
    ------
    RobotError
        With the file, the key and what was expected.
    """
    if path is None:
        return Sidecar()
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RobotError(f"There is no sidecar file {path}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise RobotError(f"{path} is not valid TOML: {error}.") from None
    try:
        return Sidecar.model_validate(content)
    except ValidationError as error:
        raise RobotError(f"{path}: {first_problem(error)}.") from None


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a validation as ``key: what was expected``."""
    problem = error.errors()[0]
    where = ".".join(str(part) for part in problem["loc"]) or "file"
    if problem["type"] == "extra_forbidden":
        return f"'{where}' is not a key that is known here; remove it or check its spelling"
    return f"'{where}': {problem['msg'][0].lower()}{problem['msg'][1:]}"
