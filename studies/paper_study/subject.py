"""The robot of the paper, its four models, and its behaviour without noise."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.logs import signals
from identifiability.regression.reduction import (
    Submodel,
    build_ladder,
    ladder_model,
    ladder_path,
    read_ladder,
)
from identifiability.regression.regression import Model
from identifiability.regression.structure import BaseParameters, Structure
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory, simulate
from identifiability.simulation.forces import stribeck

#: The shipped robot that stands in for the paper's.
SHIPPED = "3-rps"

#: The paper's exciting trajectories, by condition number.
TRAJECTORIES = ("571", "595", "601")

#: Friction with a static level, Table 4: Fs [N], Stribeck velocity [m/s], shape.
STRIBECK = (600.0, 0.08, 1.0)

#: Friction of the three revolute joints, Table 5: 15 % of the slides' friction, taken numerically.
HINGE_FRICTION = {"Fv": 490.8, "Fc+": 34.2, "Fc-": 34.2}

#: Share of the largest parameter below which an exact base parameter is zero.
ZERO = 1e-6


@dataclass(frozen=True)
class Subject:
    """A robot with the models that are fitted to it.

    Attributes
    ----------
    structure : Structure
    models : tuple of Submodel
        Models 1 to 4.
    """

    structure: Structure
    models: tuple[Submodel, ...]

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def model(self) -> Model:
        """The unpruned model."""
        return self.structure.model

    @property
    def base(self) -> BaseParameters:
        """Its base parameters."""
        return self.structure.base

    @cached_property
    def exact(self) -> tuple[Array, ...]:
        """Exact parameters of each model: those of the robot file."""
        stated = self.structure.nominal_base
        values = [np.linalg.lstsq(r.M, stated - r.fixed, rcond=None)[0] for r in self.models]
        # Groups that cancel in a symmetric robot come out as rounding errors.
        return tuple(np.where(np.abs(x) < ZERO * np.abs(x).max(), 0.0, x) for x in values)

    def without_actuators(self) -> Subject:
        """Return the subject whose models have no actuator inertia (Table 6)."""
        names = [f"{joint}.Jr" for joint in self.robot.joints]
        submodels = tuple(r.without(names) for r in self.models)
        return Subject(self.structure, submodels)


@dataclass(frozen=True)
class ExactLog:
    """Motion of the actuated joints and their torque without noise, each (N, n) along t (N,)."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array


def fit_periodic(t: Array, q: Array, period: float, harmonics: int) -> tuple[Array, Array, Array]:
    """Return q, dq, ddq (N, n) of the Fourier series nearest to positions (N, n) [Swevers 1997]."""
    centre = q.mean(0)  # small numbers, small rounding
    positions = signals.fourier_bases(t, period, harmonics)[0]
    series = np.linalg.lstsq(positions, q - centre, rcond=None)[0]
    series[0] += centre
    return signals.fourier_motion(t, period, series)


@cache
def load_subject(robot: str = SHIPPED) -> Subject:
    """Return a robot (shipped name or file) with the ladder in the folder of its file."""
    machine = Robot.load(robot)
    path = ladder_path(machine)
    if path is None:
        raise FileNotFoundError(f"There is no ladder.toml beside {machine.path}.")
    entry = read_ladder(path)
    structure = Structure.of(machine, ladder_model(entry))
    return Subject(structure, build_ladder(entry, structure))


@cache
def robot_digest(robot: str) -> str:
    """Return a digest of the files in a robot's folder: bodies, ladder, trajectories."""
    found = hashlib.sha256()
    for path in sorted(Path(Robot.load(robot).path).parent.iterdir()):
        if path.suffix in (".xml", ".urdf", ".toml", ".json"):
            found.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def check_robot(robot: str, digest: str) -> None:
    """Raise an error if files differ from those at the start of a study.

    Parameters
    ----------
    robot : str
        Shipped name or file.
    digest : str
        Of `robot_digest`.

    Raises
    ------
    RobotError
    """
    if robot_digest(robot) != digest:
        raise RobotError(
            f"The files of robot '{robot}' are not the same here as where the study was started; "
            "give every worker the same ones, and leave them alone meanwhile."
        )


def hinge_friction(robot: Robot) -> Mapping[str, float]:
    """Return the friction of Table 5 at the three revolute joints."""
    hinges = [a.name for a in robot.passive_axes if a.name.startswith("hinge")]
    return {f"{h}.{kind}": value for h in hinges for kind, value in HINGE_FRICTION.items()}


@cache
def exact_log(robot: str, trajectory: str, samples: int, discrepancy: str = "") -> ExactLog:
    """Return the exact log of a trajectory, by the simulator.

    Parameters
    ----------
    robot : str
        Shipped name or file.
    trajectory : str
    samples : int
    discrepancy : {"", "stribeck", "hinges"}
        What the robot has and the models do not.
    """
    machine = load_subject(robot).robot
    move = PrescribedMotion.of(shipped_trajectory(machine, trajectory), samples)
    values = hinge_friction(machine) if discrepancy == "hinges" else {}
    with threadpool_limits(1, "blas"):
        tau = simulate(machine, move, noise=Noise(), parameters=values).tau
    if discrepancy == "stribeck":
        static, velocity, shape = STRIBECK
        for k, joint in enumerate(machine.joints):
            excess = static - machine.nominal[f"{joint}.Fc+"]
            tau = (
                tau
                + np.eye(len(machine.joints))[k]
                * (stribeck(move.dq[:, k], excess, velocity, shape)[:, None])
            )
    return ExactLog(move.t, move.q, move.dq, move.ddq, tau)
