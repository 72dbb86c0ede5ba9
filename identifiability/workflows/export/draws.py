"""`Draws`: robots consistent with the logs, for domain randomisation of a simulator.

The estimate of the unpruned model is normal about the values to use, with the covariance of its
result. It does not constrain directions that the motion never excites. The prior of bodies is the
file's value within a share of their size. Joints have almost no prior. The sampler of posteriors
draws from this normal on the physical set. Every draw is therefore physically consistent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd

from identifiability.effects.vocabulary import Kind, by_effect, values_not_in_file
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array, Strings, name_each
from identifiability.foundation.options import Expected, FilePath, Positive, Seed, checked
from identifiability.foundation.output import check_ending
from identifiability.foundation.presenter import presented
from identifiability.foundation.values import frozen
from identifiability.logs.tables import PARQUET, write_table
from identifiability.physical.fitted_model import LeastSquares, physical_set
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.posterior.ensemble import ENSEMBLES, sample_posterior
from identifiability.posterior.target import Prior, Target
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.belief import start_inside, state_prior, widest
from identifiability.workflows.predict import Fit, find_fit

from .workflow import state_lost, write_parameters

#: Steps of the sampler: before the first draw, and from one that is kept to the next.
WARMUP, APART, WALKERS = 12, 3, 16


@frozen(kw_only=True)
class Draws:
    """Robots consistent with the logs, made by `draw_robots`.

    Attributes
    ----------
    structure : Structure
    values : (N, p)
        Standard parameters in the order of the structure's columns.
    share : float
        By which bodies may differ from the file's.
    servos : DataFrame
        Delay of commands [s] and gains that the logs determine, of each draw.
    hints : tuple of str
        Differences from the inputs with which the result was made.
    """

    structure: Structure
    values: Array
    share: float
    servos: pd.DataFrame = field(default_factory=pd.DataFrame)
    hints: Strings = ()

    @property
    def robots(self) -> Iterator[dict[str, float]]:
        """Parameters by name, of each draw."""
        for row in self.values:
            yield name_each(self.structure.columns, row)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a draw, one column a standard parameter or number of servos [SI]."""
        columns = list(self.structure.columns)
        own = pd.DataFrame(self.values, columns=columns)
        return pd.concat([own, self.servos], axis=1)

    def write(self, path: str | Path) -> tuple[Path, ...]:
        """Write a table (.csv, .parquet), or a robot file a draw, ``fitted-001.xml`` ….

        Raises
        ------
        OutputError
        """
        path = Path(path)
        check_ending(path, ".csv", *PARQUET, ".xml", ".urdf")
        if path.suffix.lower() not in (".xml", ".urdf"):
            return (write_table(path, self.to_frame()),)
        digits = max(3, len(str(len(self.values))))
        written = []
        robot, shapes = self.structure.robot, self.structure.shapes
        lacking = self.lacking(path)
        for k, values in enumerate(self.robots, start=1):
            name = f"{path.stem}-{k:0{digits}d}{path.suffix}"
            file = path.with_name(name)
            how: Any = {"shapes": shapes, "comment": lacking}
            written.append(write_parameters(robot, values, file, **how).robot)
        return tuple(written)

    def lacking(self, path: str | Path) -> str:
        """Return the effects that robot files of a format cannot hold, in words; else empty."""
        kinds: dict[str, Kind] = {".xml": "mjcf", ".urdf": "urdf"}
        kind = kinds.get(Path(path).suffix.lower())
        if kind is None:
            return ""
        robot, values = self.structure.robot, next(self.robots)
        lost = values_not_in_file(robot, values, kind)
        effects = by_effect(robot, lost, self.structure.shapes)
        name = phrase("exported", "each")
        return state_lost(robot, values, effects, kind, name)

    @property
    @presented
    def statement(self) -> str:
        """Description of the draws."""
        raise NotImplementedError


@checked
def draw_robots(
    robot: RobotLike,
    result: FilePath | Fit,
    count: Annotated[int, Expected("a positive whole number", lambda n: n > 0)] = 100,
    *,
    seed: Seed = 0,
    prior: Positive | None = None,
) -> Draws:
    """Draw robots that are consistent with the logs of a result.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : path or Fit
        JSON of `analyze`, `prune` or `diagnose`, or its fit.
    count : int
    seed : int
    prior : float, optional
        Share by which drawn bodies may differ from the file's (a standard deviation); by default a
        fifth where the robot has servos, else as the sidecar says (``prior_relative``).

    Raises
    ------
    IdentifiabilityError
        If the file is no result or one of another robot, or the robot file's bodies cannot exist.
    """
    robot = Robot.of(robot)
    fit = find_fit(result, robot)
    # Share of their size by which bodies differ from the file's, where logs hold no torque.
    usual = robot.said.prior_relative if robot.servo is None else PHYSICAL_RULES.body_within
    share = usual if prior is None else prior
    rng = np.random.default_rng(seed)
    try:
        values = _draw_values(fit, share, count, rng)
    except ValueError as error:
        raise IdentifiabilityError(f"No robot can be drawn: {error}") from None
    drawn = {name: rng.normal(x, sd, count) for name, (x, sd) in fit.servo.items()}
    servos = pd.DataFrame(drawn)
    return Draws(
        structure=fit.structure, values=values, share=share, servos=servos, hints=fit.hints
    )


def _draw_values(fit: Fit, share: float, count: int, rng: np.random.Generator) -> Array:
    """Return standard parameters of physically consistent robots, (count, p)."""
    structure = fit.structure
    data = fit.of_standard
    prior = _prior(structure, data, share)
    target = Target(data, prior, physical_set(structure), variance=1.0)
    start = start_inside(target, structure.nominal)
    steps = APART * -(-count // (ENSEMBLES * WALKERS))
    found = sample_posterior(target, start, rng, walkers=WALKERS, warmup=WARMUP, draws=steps)
    kept = found.draws[:, :, APART - 1 :: APART].reshape(-1, len(structure.columns))
    return kept[rng.permutation(len(kept))[:count]]


def _prior(structure: Structure, data: LeastSquares, share: float) -> Prior:
    """Return the prior: bodies within a share of the file's, all else almost free."""
    prior = state_prior(structure, data, share)
    known = np.isin(structure.columns, list(structure.robot.prior))
    known[structure.inertial] = True
    widened = np.maximum(prior.sd, widest(data))
    return Prior(prior.mean, np.where(known, prior.sd, widened))
