"""`identify_gains`: what one unit of a torque column is, from logs with and without a known load.

Currents and uncalibrated sensors tell torque up to a factor of each joint, ``τ = g i``. Parameters
that are fitted to them take the factor up, and no log by itself tells. A load that is known does:
for each joint by itself, ``i = W (φ/g) + p (1/g)``, where ``p`` is the torque of the load alone,
zero in logs without it [Gautier & Briot 2014; Gaz & De Luca 2017]. Friction may differ between
loaded and unloaded logs: it grows with load, and warms up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from threadpoolctl import threadpool_limits

from identifiability.effects.payload import Payload
from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.options import OptionError, Positive, checked
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.plan import has_motors
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.regression.reduction import USUAL_EFFECTS, ModelLike, choose_model
from identifiability.regression.regression import Model, Regression
from identifiability.robot import Robot, RobotLike
from identifiability.robot.weights import Point, ten_parameters
from identifiability.workflows.gains.fit import fit_joint, gather, judge
from identifiability.workflows.gains.result import Gains
from identifiability.workflows.opening import Logs, in_memory, read_recordings

#: The model of the robot without its load.
EFFECTS = (*USUAL_EFFECTS[:-1], "torque_offset", USUAL_EFFECTS[-1])


@checked
def identify_gains(
    robot: RobotLike,
    logs: Logs,
    loaded: Logs,
    *,
    mass: Positive,
    centre: Point = (0.0, 0.0, 0.0),
    inertia: Point = (0.0, 0.0, 0.0),
    body: str | None = None,
    model: ModelLike | None = None,
    preparation: Preparation | None = None,
) -> Gains:
    """Identify what one unit of each torque column is, from a load that is known.

    Parameters
    ----------
    robot : Robot, path or shipped name
        What its sidecar says of gains, ratios and signs is left aside: the result replaces it.
    logs : log, path, DataFrame, or several
        Without the load; columns ``<joint>.tau`` or ``<joint>.current`` in any unit.
    loaded : the same
        With it.
    mass : float [kg]
        Of the load.
    centre : (3,) [m]
        Its centre of mass in the frame of the body's joint.
    inertia : (3,) [kg·m²]
        Its moments of inertia about its centre, along the axes of that frame.
    body : str, optional
        Which it is fixed to; by default the last one.
    model : Model, sequence of str or path of a model file, optional
        Effects of the robot without the load; by default bodies, viscous and Coulomb friction,
        offsets and actuator inertia.
    preparation : Preparation, optional
        How derivatives are made.

    Raises
    ------
    LogError, OptionError
    """
    with threadpool_limits(1):
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        if robot.known_torque:  # in N·m, and what the columns are in is what is asked
            raise OptionError(
                "Gains are identified without [[known_torque]]: take it out of the sidecar."
            )
        place, load = _load_of(robot, mass, centre, inertia, body)
        known = replace(Conventions.of(robot), raw_torque=True)
        recordings = read_recordings(logs, loaded, known, preparation)
        without, with_load = (in_memory(x, Log) for x in (recordings.fitted, recordings.held))
        if not with_load:
            raise LogError("No log with the load was given; give at least one.")
        _refuse_motors(robot, [*without, *with_load])
        how = settle_cutoff(robot, [*without, *with_load], preparation)
        samples = [prepare_samples(robot, log, how) for log in (*without, *with_load)]
        chosen = choose_model(model, EFFECTS)
        loaded_model = Model((*chosen.effects, Payload()))
        every = Regression(robot, loaded_model, tuple(samples))
        rows = gather(every, len(without), place, load)
        tau, torque, columns, log = rows
        found = [
            fit_joint(tau[:, j], torque[:, j], columns[:, j], log) for j in range(len(robot.joints))
        ]
        hints = (*recordings.hints, *chain.from_iterable(s.hints for s in samples))
    return Gains(robot.name, place, float(mass), judge(robot.joints, found), hints)


def _load_of(
    robot: Robot, mass: float, centre: Point, inertia: Point, body: str | None
) -> tuple[str, Array]:
    """Return the body that carries the load, and its ten parameters there.

    Raises
    ------
    OptionError
    """
    places = [p.owner for p in Payload().parameters(robot)][:: len(INERTIAL_KINDS)]
    if body is None and len(places) > 1:
        raise OptionError(f"The load may be fixed to {listing(places)}; name one of them as body.")
    place = places[-1] if body is None else body
    if place not in places:
        raise OptionError(
            f"'{place}' is no last body of the robot{near_match(place, places)} "
            f"A load is fixed to {listing(places)}."
        )
    c, own = np.asarray(centre, float), np.asarray(inertia, float)
    if c.shape != (3,) or own.shape != (3,) or not np.isfinite([*c, *own]).all() or own.min() < 0:
        raise OptionError("centre and inertia are three numbers each, x, y and z, of real bodies.")
    return place, ten_parameters(mass, c, own)


def _refuse_motors(robot: Robot, logs: Sequence[Log]) -> None:
    for log in logs:
        if has_motors(robot, log):
            raise LogError(
                f"{log.name} has motors that mix joints; gains are identified from torques of "
                "joints."
            )
