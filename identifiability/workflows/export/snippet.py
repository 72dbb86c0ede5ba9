"""`write_snippet`: torque of joints that a robot file cannot hold, as a function for MuJoCo.

The tables hold torque that depends only on the speed and position of its joint. One table has
levels of dry friction for the simulator's friction. The other has the remaining torque. Isaac uses
the same tables. Springs over two joints have a potential instead.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from identifiability.effects import FAMILIES, AlongAxes, find_family, joints_of, title_of
from identifiability.effects.effect import POSTURES, RESTS, SPEEDS
from identifiability.effects.springs import PRODUCTS, SpringOverTwo
from identifiability.effects.transmission import PositionRipple
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text
from identifiability.foundation.quoting import for_python
from identifiability.foundation.values import Json
from identifiability.robot import Robot
from identifiability.robot.description import Axis
from identifiability.simulation.motion import usual_limits

#: Points of a table, and of every four periods of a ripple in it.
POINTS = 161

#: Families of curves over a joint's own speed or position.
OWN = {
    family.title: family.effect
    for family in FAMILIES.values()
    if isinstance(family.effect, AlongAxes)
    and family.name != "coulomb_friction"  # one level may be that of both directions
    and (family.told_by in (SPEEDS, RESTS, POSTURES) or family.name == "position_friction")
    and not family.loaded
}

TEXT = '''"""Torque that the robot file cannot hold: in MuJoCo, when the model is loaded,
`mujoco.set_mjcb_passive(add_torque)`.

TABLES has of each joint the levels of dry friction over |speed| and over position, and torque over
speed and over position, as (places, values) [SI]; a controller of Isaac interpolates them alike.
SPRINGS has of two joints C in their potential f(q1) C f(q2), f(q) = (1, q, q²/2, sin q, cos q).
"""

import numpy as np

FILE = {file}
TABLES = {tables}
SPRINGS = {springs}


def add_torque(model, data):
    for name, table in TABLES.items():
        at, dof = model.joint(name).qposadr[0], model.joint(name).dofadr[0]
        q, v = data.qpos[at], data.qvel[dof]
        level = np.interp(abs(v), *table["friction over speed"])
        level += np.interp(q, *table["friction over position"])
        model.dof_frictionloss[dof] = max(level, 0.0)
        data.qfrc_passive[dof] -= np.interp(v, *table["torque over speed"])
        data.qfrc_passive[dof] -= np.interp(q, *table["torque over position"])
    for first, second, C in SPRINGS:
        joints = model.joint(first), model.joint(second)
        q = data.qpos[[joint.qposadr[0] for joint in joints]]
        one = np.ones(2)
        f = np.array([one, q, q * q / 2, np.sin(q), np.cos(q)]).T
        slope = np.array([0 * q, one, q, np.cos(q), -np.sin(q)]).T
        data.qfrc_passive[joints[0].dofadr[0]] -= slope[0] @ C @ f[1]
        data.qfrc_passive[joints[1].dofadr[0]] -= f[0] @ C @ slope[1]
'''


#: Effects of a joint by title, each with the values that the robot file lacks.
Parts = dict[str, tuple[AlongAxes, list[float]]]


def write_snippet(whole: Robot, alone: Robot, path: Path) -> tuple[Path | None, list[str]]:
    """Write the torque that a robot file lacks; return the path, and titles of its effects.

    Parameters
    ----------
    whole, alone : Robot
        The robot of file and sidecar, and that of the file alone.
    path : Path
        Path of the function, if one is written.
    """
    tables = {}
    titles = dict[str, None]()
    for axis in (a for a in whole.axes if a.name in whole.joints):
        parts = _find_parts(whole, alone, axis)
        if parts:
            titles |= dict.fromkeys(parts)
            friction = alone.nominal.get(f"{axis.name}.Fc", 0.0)
            tables[axis.name] = _tabulate(whole, axis, parts, friction)
    springs = [*_list_springs(whole, alone)]
    if not (tables or springs):
        return None, []
    titles |= dict.fromkeys([title_of(SpringOverTwo.name)] if springs else [])
    file = for_python(alone.path.name)
    written = {
        name: for_python(x, width=96) for name, x in (("tables", tables), ("springs", springs))
    }
    text = TEXT.format(file=file, **written)
    return write_text(path, text), [*titles]


def _list_springs(whole: Robot, alone: Robot) -> Iterator[tuple[str, str, list[list[float]]]]:
    """Yield the joints of each spring over two of them, and the factors of its potential."""
    for place in find_family(SpringOverTwo.name).places(whole):
        names = [f"{place}.{kind}" for kind in SpringOverTwo.kinds]
        factors = np.zeros((5, 5))
        factors[tuple(PRODUCTS.T)] = [
            whole.nominal.get(n, 0.0) - alone.nominal.get(n, 0.0) for n in names
        ]
        if factors.any():
            first, second = joints_of(SpringOverTwo.name, place)
            yield first, second, factors.tolist()


def _find_parts(whole: Robot, alone: Robot, axis: Axis) -> Parts:
    """Return the effects of a joint that the robot file lacks."""
    parts: Parts = {}
    for title, effect in OWN.items():
        here = effect.placed(axis.name)
        names = [f"{axis.name}.{kind}" for kind in here.kinds(whole, axis)]
        values = [whole.nominal.get(n, 0.0) - alone.nominal.get(n, 0.0) for n in names]
        if any(values):
            parts[title] = here, values
    return parts


def _tabulate(robot: Robot, axis: Axis, parts: Parts, friction: float) -> Json:
    """Return the tables of a joint: dry friction and torque, over speed and over position.

    Parameters
    ----------
    robot, axis, parts
    friction : float [N·m or N]
        Level of dry friction that the robot file states.
    """
    k = robot.joints.index(axis.name)
    usual = usual_limits(robot)
    home = robot.actuated_positions(robot.home[None])[0, k]
    fastest = min(robot.speed_limits[k], 10.0 * usual["v"][k])
    limits = robot.limits[k]
    ends = np.where(np.isfinite(limits), limits, usual["q"][k])
    v = np.geomspace(1e-4 * fastest, fastest, POINTS)
    q = _positions(robot, axis, parts, ends)
    at = partial(_halves, robot, axis, parts.values(), home)
    level, torque = at(np.full(POINTS, home), v)
    levels, torques = at(q, np.full_like(q, v[0]))
    both_ways = np.append(torque[::-1], torque)
    return {
        "friction over speed": _rounded(v, friction + level),
        "friction over position": _rounded(q, levels - level[0]),
        "torque over speed": _rounded(np.append(-v[::-1], v), both_ways),
        "torque over position": _rounded(q, torques - torque[0]),
    }


def _positions(robot: Robot, axis: Axis, parts: Parts, ends: Array) -> Array:
    """Return the positions of a table between two ends, (points,): more where a ripple is fine."""
    ripples = [x for x, _ in parts.values() if isinstance(x, PositionRipple)]
    shortest = min((x.shape(robot, axis) for x in ripples), default=np.inf)
    fours = int(np.ptp(ends) / shortest / 4)
    return np.linspace(ends[0], ends[1], POINTS * max(fours, 1))


def _halves(robot: Robot, axis: Axis, parts: Any, home: float, q: Array, v: Array) -> list[Array]:
    """Return the odd and the even part, in the sign of speed, of effects along an axis."""
    both = []
    for sign in (1.0, -1.0):
        ones = np.ones_like(v)
        places = {
            "position": q,
            "travel": q - home,
            "speed": sign * v,
            "sign": sign * ones,
        }
        at: Any = SimpleNamespace(robot=robot, axis=axis, ones=ones, **places)
        curves = ((own, effect.curves(at)) for effect, own in parts)
        pairs = (pair for own, curve in curves for pair in zip(own, curve, strict=True))
        both.append(sum(x * y for x, y in pairs))
    forward, backward = both
    return [0.5 * (forward - backward), 0.5 * (forward + backward)]


def _rounded(x: Array, y: Array) -> tuple[list[float], ...]:
    """Return a table; a constant table has two rows, its ends."""
    # Values that are all the same but for rounding.
    rows = [0, -1] if np.ptp(y) < 1e-12 else slice(None)
    return tuple([float(f"{value:.6g}") for value in each[rows]] for each in (x, y))
