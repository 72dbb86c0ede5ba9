"""`payload`: what hangs on a body of a robot that was fitted without it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.effects.load_dependent_friction import LoadDependentFriction
from identifiability.effects.nominal import reference_values
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine
from identifiability.foundation.errors import listing, near_match
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.threads import one_thread
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.echo import noise_share
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.logs.repeats import Recording
from identifiability.physical.nominal_bodies import draw_bodies
from identifiability.physical.pseudo_inertia import natural_scale
from identifiability.regression.gather import gather_information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.changed import last_bodies
from identifiability.robot.kinematics import WORLD
from identifiability.workflows.instruments import LOUD
from identifiability.workflows.opening import Logs, require_signal
from identifiability.workflows.pairs import find_pairs, read_sides
from identifiability.workflows.payload.body import nearest_body, state_quantities
from identifiability.workflows.payload.estimate import Rubbing, estimate_load
from identifiability.workflows.payload.result import Load
from identifiability.workflows.predict import FitLike, find_fit
from identifiability.workflows.predict.about import state_missing

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
        Without it, best of the same day and along the same motion: then whatever the model gets
        wrong along it cancels.
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
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        fit = find_fit(result, robot)
        place, columns = choose_body(fit.structure, body)
        sides = read_sides(logs, without, Conventions.of(robot), fit.preparation, alone=True)
        given, other = (side.fitted for side in sides)
        how = settle_cutoff(robot, given, fit.preparation)
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
