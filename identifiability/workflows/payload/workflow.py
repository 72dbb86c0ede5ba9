"""`payload`: what hangs on a body of a robot that was fitted without it, as a `Load`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.effects.nominal import reference_values
from identifiability.effects.transmission import LoadDependentFriction
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import listing, near_match
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.echo import noise_share
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.logs.repeats import Recording
from identifiability.physical.cad_prior import draw_bodies
from identifiability.physical.pseudo_inertia import natural_scale
from identifiability.regression.gather import gather_information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.changed import last_bodies
from identifiability.robot.kinematics import WORLD
from identifiability.workflows.band import settle_band
from identifiability.workflows.instruments import LOUD
from identifiability.workflows.opening import Logs, require_signal
from identifiability.workflows.pairs import find_pairs, read_sides
from identifiability.workflows.payload.load import (
    LoadEstimate,
    Quantity,
    Rubbing,
    estimate_load,
    nearest_body,
    state_quantities,
)
from identifiability.workflows.predict import FitLike, find_fit
from identifiability.workflows.predict.fit import state_missing

# `Load`: mass, centre and inertia of what hangs on a body, in numbers and words.


#: Level at which friction is said to be another one than without the load [family-wise].
LEVEL = 0.05

#: What masses are stated by.
GAINS = (
    "Mass and moments are proportional to the torque constants and gear ratios by which the torque "
    "was read: as many percent as these are off, so is every number."
)

#: Torque that the load leaves is spoken of where it is so many times what the result left.
LARGER = 1.5


@frozen(kw_only=True)
class Load(Result):
    """What hangs on a body. Make it with `payload`.

    Attributes
    ----------
    robot : Robot
    body : str
        Which carries it; positions and moments are along the axes of its joint's frame.
    model : str
        Name of the fitted model.
    logs, without : tuple of str
        Logs with the load, and without.
    pairs : tuple of (str, str)
        Those that were compared, of the same motion.
    estimate : LoadEstimate
        What the logs say by themselves.
    parameters : (10,)
        Of the nearest real body, in the order of `INERTIAL`, about the origin of the frame.
    quantities : tuple of Quantity
        Mass, centre, and moments of inertia about it.
    usual : (n,) [N·m or N]
        What the result left of the torque.
    hints : tuple of str
    origin : str
        Name of the file of the result without the load.
    """

    schema: ClassVar[str] = "identifiability/payload/1"

    robot: Robot
    body: str
    model: str
    logs: tuple[str, ...]
    without: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    estimate: LoadEstimate
    parameters: Array
    quantities: tuple[Quantity, ...]
    usual: Array
    hints: tuple[str, ...] = ()
    origin: str = "result.json"

    @property
    def of(self) -> Mapping[str, Quantity]:
        """The quantities by name."""
        return {q.name: q for q in self.quantities}

    @property
    def mass(self) -> Quantity:
        """Of the load [kg]."""
        return self.of["mass"]

    @property
    def answer(self) -> str:
        """Mass and where, in one sentence."""
        mass = self.mass
        if not np.isfinite(mass.half):
            return f"These logs do not tell the mass of what hangs on {self.body}."
        if not mass.told:
            return f"Nothing surely hangs on {self.body}: at most {mass.high:.3g} kg."
        text = f"{measured(mass.value, mass.half, 'kg')} at body {self.body}"
        centre = [self.of[f"centre {axis}"] for axis in "xyz"]
        if all(q.told for q in centre):
            at = ", ".join(measured(q.value, q.half) for q in centre)
            text += f", its centre at ({at}) m in the frame of {self.body}"
        return f"{text} (95 %)."

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        texts = [self.answer, self._moments(), self._untold(), self._agreement(), self.friction]
        texts += [*self.caveats, GAINS if self.mass.told else ""]
        return " ".join(t for t in (*texts, *self.hints) if t)

    def _moments(self) -> str:
        told = [q for q in self.quantities if q.name.startswith("I") and q.told]
        texts = [f"{q.name} {measured(q.value, q.half)}" for q in told]
        return f"Moments about its centre: {listing(texts)} kg·m²." if texts else ""

    def _untold(self) -> str:
        if not (self.mass.told and np.isfinite(self.mass.half)):
            return ""
        by: dict[str, list[str]] = {}
        for q in self.quantities:
            if not q.told:
                by.setdefault(q.why, []).append(q.name)
        texts = [f"{listing(names)} ({why})" for why, names in by.items()]
        return f"Not told: {'; '.join(texts)}." if texts else ""

    def _agreement(self) -> str:
        motions = self.estimate.motions
        if motions is None:
            return "" if self.pairs else "One motion cannot show what another would change."
        rows = self.log_frame().to_dict("records")
        each = listing([f"{r['log']} {measured(r['mass'], r['half'], 'kg')}" for r in rows], 4)
        if motions.agree:
            return f"The logs agree ({each})."
        return f"The logs disagree ({each}): intervals are widened to hold all of them."

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Joints whose friction is surely another one than without the load."""
        level = LEVEL / max(len(self.estimate.rubbing), 1)
        return tuple(joint for joint, p in self.estimate.rubbing.items() if p < level)

    @property
    def friction(self) -> str:
        """What became of friction, in a sentence; empty where it did not change for sure."""
        if not self.rubbing:
            return ""
        many = "differ" if len(self.rubbing) > 1 else "differs"
        return (
            f"Friction of {listing(self.rubbing, 6)} {many} from that without the load, which the "
            "intervals hold."
        )

    @property
    def caveats(self) -> tuple[str, ...]:
        """What makes the answer doubtful, and what to do."""
        ratio = self.estimate.rms / np.maximum(self.usual, 1e-300)
        if len(self.pairs) == len(self.logs) or ratio.max() < LARGER:
            return ()
        k = int(np.argmax(ratio))
        return (
            f"But the torque of {self.robot.joints[k]} is left {ratio[k]:.2g} × as far off as by "
            "the result's own logs: the robot changed since (friction does, with temperature), or "
            "the load is not rigid or hangs elsewhere (--body). Add a log of the same motion "
            "without the load (--without); compare says what changed.",
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a quantity: ``name``, value, interval, unit, whether it is told, why."""
        return pd.DataFrame([asdict(q) for q in self.quantities])

    def log_frame(self) -> pd.DataFrame:
        """Return the mass by each log alone, with half of its interval for noise; none of one."""
        motions = self.estimate.motions
        if motions is None:
            return pd.DataFrame(columns=["log", "mass", "half"])
        at = INERTIAL.index("m")
        names = [self.logs[k] for k in self.estimate.logs]
        return pd.DataFrame(
            {"log": names, "mass": motions.values[:, at], "half": REACH * motions.sd[:, at]}
        )

    @property
    def possible(self) -> bool:
        """Whether the estimate is a real body by itself."""
        return bool(np.allclose(self.parameters, self.estimate.theta, rtol=1e-6, atol=1e-12))

    def to_dict(self) -> dict[str, Any]:
        """Return the load in the documented JSON schema."""
        theta = dict(zip(INERTIAL, self.parameters.tolist(), strict=True))
        alone = dict(zip(INERTIAL, self.estimate.theta.tolist(), strict=True))
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.model,
            "body": self.body,
            "statement": self.statement,
            "quantities": [asdict(q) for q in self.quantities],
            "parameters": theta,
            "estimate": alone,
            "covariance": self.estimate.covariance.tolist(),
            "order": list(INERTIAL),
            "possible": self.possible,
            "logs": list(self.logs),
            "without": list(self.without),
            "pairs": [list(p) for p in self.pairs],
            "by_log": self.log_frame().to_dict("records"),
            "caveats": list(self.caveats),
            "friction_changed": list(self.rubbing),
        }


# `payload`: what hangs on a body of a robot that was fitted without it.


#: How often the load is found: friction that follows it takes what it was found to be before.
WEIGHED = 2


@checked
def payload(
    robot: RobotLike,
    result: FitLike,
    logs: Logs,
    without: Logs = (),
    *,
    body: str | None = None,
    engine: Engine | None = None,
) -> Load:
    """Find mass, centre and inertia of what hangs on a body.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : Fit, Analysis, Ladder, Diagnosis or path
        Fitted to logs without the load. What it does not know of the robot enters every interval.
    logs : log, path, DataFrame, or several
        With the load; they are prepared like the fitted ones, with the same cut-off.
    without : the same, optional
        Logs without the load, best of the same day and along the same motion: then whatever the
        model gets wrong along it cancels.
    body : str, optional
        Which carries the load; by default the last of a chain, or the platform, on which most
        loops end.
    engine : Engine, optional
        Where logs that are too long for memory are worked on.

    Raises
    ------
    OptionError
        If there is no such body, or several can carry the load and none was named.
    IdentifiabilityError
        If the result is about another robot, or a log does not fit it.
    """
    with one_thread("blas"):
        robot = Robot.of(robot)
        fit = find_fit(result, robot)
        place, columns = choose_body(fit.structure, body)
        sides = read_sides(logs, without, Conventions.of(robot), fit.preparation, alone=True)
        given, other = (side.fitted for side in sides)
        how = settle_band(fit.structure, given, fit.preparation)
        pairs = find_pairs(robot, given, other, how)
        runner = engine or Serial()

        def prepare(recordings: tuple[Recording, ...], paired: set[int]) -> list[Prepared]:
            left = [r for k, r in enumerate(recordings) if k not in paired]
            samples = [prepare_log(robot, r, how, engine=runner) for r in left]
            require_signal(samples, "weighed")
            hints.extend(text for s in samples for text in s.hints)
            return samples

        hints = [text for side in sides for text in side.hints]
        hints += _tell_noise(robot, given, how)
        samples = prepare(given, {p.at[0] for p in pairs})
        bare = [
            gather_information(fit.structure.regression([s]), engine=runner)
            for s in prepare(other, {p.at[1] for p in pairs})
        ]
        rubbing = Rubbing(structure=fit.structure)
        for _ in range(WEIGHED):
            loaded = [gather_information(rubbing.regression([s]), engine=runner) for s in samples]
            found = estimate_load(fit, columns, rubbing, loaded, bare, pairs)
            nearest = nearest_body(found)
            rubbing = Rubbing(
                structure=fit.structure, carried=_carried(fit.structure, place, nearest)
            )
        length = float(np.median(natural_scale(_bodies(fit.structure))[1]))
    return Load(
        robot=robot,
        body=place,
        model=fit.rung.name,
        logs=tuple(r.name for r in given),
        without=tuple(r.name for r in other),
        pairs=tuple((given[p.at[0]].name, other[p.at[1]].name) for p in pairs),
        estimate=found,
        parameters=nearest,
        quantities=state_quantities(found, nearest, length),
        usual=fit.spread.low,
        hints=tuple(dict.fromkeys(filter(None, (state_missing(fit.missing), *hints)))),
        origin=fit.origin,
    )


def _carried(structure: Structure, body: str, load: Array) -> tuple[Mapping[str, float], ...]:
    """Return by which values gears carry what they do: with the load, and without.

    Where the model itself has friction by load, it is that without.
    """
    bare = reference_values(structure.robot)
    loaded = dict(bare)
    for kind, value in zip(INERTIAL, load.tolist(), strict=True):
        loaded[f"{body}.{kind}"] = loaded.get(f"{body}.{kind}", 0.0) + value
    return (loaded,) if LoadDependentFriction.name in structure.model.names else (loaded, bare)


def _tell_noise(robot: Robot, logs: Sequence[Recording], how: Preparation) -> list[str]:
    """Return what noise of the motion does to the load, where it does."""
    loud = {
        log.name: share
        for log in logs
        if isinstance(log, Log) and (share := noise_share(robot, log, _cutoff(log, how))) > LOUD
    }
    if not loud:
        return []
    return [
        f"{listing(loud, 4)}: noise of the measured motion has up to "
        f"{100 * max(loud.values()):.2g} % of an acceleration (rms), which pulls the load's "
        "numbers off, and intervals do not hold that; measure '<joint>.dq' and '<joint>.ddq', or "
        "lower the cut-off of the result (analyze --cutoff)."
    ]


def _cutoff(log: Log, how: Preparation) -> float | None:
    """Return the low-pass of computed derivatives; None where they were measured."""
    return None if {"dq", "ddq"} <= set(log.channels) else how.cutoff


def choose_body(structure: Structure, body: str | None) -> tuple[str, Array]:
    """Return the body that carries the load, and base parameters (b, 10) of the load's ten.

    Raises
    ------
    OptionError
    """
    robot = structure.robot
    if body is None:
        last = last_bodies(robot)
        # Points of loops hang on single axes, of which a body's joint may have several.
        axes = np.repeat(np.arange(robot.model.njoints - 1), list(robot.model.nvs)[1:])
        points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
        ends = Counter(robot.bodies[axes[joint]] for joint in points if joint != WORLD)
        count = [ends[b] for b in last]
        best = [b for b, c in zip(last, count, strict=True) if c == max(count)]
        if len(best) > 1:
            raise OptionError(
                f"The load may hang on {listing(best, 8)}; name its body (--body, body=…)."
            )
        body = best[0]
    if body not in robot.bodies:
        raise OptionError(
            f"'{body}' is no moving body of {robot.name}{near_match(body, robot.bodies)} A load "
            f"can hang on {listing(robot.bodies, 12)}."
        )
    stems = list(structure.bodies)
    if f"{body}." not in stems:
        raise OptionError(
            "The result's model has no bodies to which a load could be added (rigid_body); fit one "
            "that has."
        )
    return body, structure.G[:, structure.inertial[stems.index(f"{body}.")]]


def _bodies(structure: Structure) -> Array:
    """Return the ten parameters of every body that the robot file states, or what stands in."""
    theta: Array = draw_bodies(structure).phi[structure.inertial]
    return theta
