"""`write_snippet`: torque of joints that a robot file cannot hold, as a function for MuJoCo.

What depends on a joint's own speed and position alone is tabulated: levels of dry friction, which
the simulator's friction takes over, and torque beside it. Its tables are those of Isaac, too.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from identifiability.effects import FAMILIES, AlongAxes
from identifiability.effects.effect import POSTURES, RESTS, SPEEDS
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text
from identifiability.foundation.quoting import for_python
from identifiability.robot import Robot
from identifiability.robot.description import Axis
from identifiability.simulation.motion import usual_limits

#: Points of a table.
POINTS = 161

#: Families of curves over a joint's own speed or position.
OWN = {
    family.title: family.effect
    for family in FAMILIES.values()
    if isinstance(family.effect, AlongAxes)
    and family.name != "coulomb_friction"  # one level stands for both directions, too
    and (family.told_by in (SPEEDS, RESTS, POSTURES) or family.name == "position_friction")
    and not family.loaded
}

TEXT = '''"""Torque that the robot file cannot hold: in MuJoCo, when the model is loaded,
`mujoco.set_mjcb_passive(add_torque)`.

TABLES has of each joint the levels of dry friction over |speed| and over position, and torque over
speed and over position, as (places, values) [SI]; a controller of Isaac interpolates them alike.
"""

import numpy as np

FILE = {file}
TABLES = {tables}


def add_torque(model, data):
    for name, table in TABLES.items():
        at, dof = model.joint(name).qposadr[0], model.joint(name).dofadr[0]
        q, v = data.qpos[at], data.qvel[dof]
        level = np.interp(abs(v), *table["friction over speed"])
        level += np.interp(q, *table["friction over position"])
        model.dof_frictionloss[dof] = max(level, 0.0)
        data.qfrc_passive[dof] -= np.interp(v, *table["torque over speed"])
        data.qfrc_passive[dof] -= np.interp(q, *table["torque over position"])
'''


def write_snippet(whole: Robot, alone: Robot, path: Path) -> tuple[Path | None, list[str]]:
    """Write what a robot has beside its file; return the path, and titles of effects in it.

    Parameters
    ----------
    whole, alone : Robot
        As file and sidecar say, and as the file alone does.
    path : Path
        Where it is written if anything is.
    """
    tables, found, usual = {}, dict[str, None](), usual_limits(whole)
    for axis in (a for a in whole.axes if a.name in whole.joints):
        k, parts = whole.joints.index(axis.name), list[tuple[AlongAxes, list[float]]]()
        for title, effect in OWN.items():
            here = effect.placed(axis.name)
            names = [f"{axis.name}.{kind}" for kind in here.kinds(whole, axis)]
            values = [whole.nominal.get(n, 0.0) - alone.nominal.get(n, 0.0) for n in names]
            if any(values):
                parts.append((here, values))
                found[title] = None
        if not parts:
            continue
        home = whole.actuated_positions(whole.home[None])[0, k]
        most = min(whole.speed_limits[k], 10.0 * usual["v"][k])
        low, high = np.where(
            np.isfinite(whole.limits[k]),
            whole.limits[k],
            usual["q"][k],
        )
        v, q = np.geomspace(1e-4 * most, most, POINTS), np.linspace(low, high, POINTS)
        at = partial(_halves, whole, axis, parts, home)
        (level, torque), (levels, torques) = (
            at(np.full(POINTS, home), v),
            at(q, np.full(POINTS, v[0])),
        )
        own = alone.nominal.get(f"{axis.name}.Fc", 0.0)
        tables[axis.name] = {
            "friction over speed": _rounded(v, own + level),
            "friction over position": _rounded(q, levels - level[0]),
            "torque over speed": _rounded(np.append(-v[::-1], v), np.append(torque[::-1], torque)),
            "torque over position": _rounded(q, torques - torque[0]),
        }
    text = TEXT.format(file=for_python(alone.path.name), tables=for_python(tables, width=96))
    return write_text(path, text) if tables else None, [*found]


def _halves(robot: Robot, axis: Axis, parts: Any, home: float, q: Array, v: Array) -> list[Array]:
    """Return what turns with the sign of speed, and what does not, of effects along an axis."""
    both = []
    for sign in (1.0, -1.0):
        places = {
            "position": q,
            "travel": q - home,
            "speed": sign * v,
            "sign": sign * np.ones_like(v),
        }
        at: Any = SimpleNamespace(robot=robot, axis=axis, ones=np.ones_like(v), **places)
        both.append(sum(x * y for e, own in parts for x, y in zip(own, e.curves(at), strict=True)))
    return [0.5 * (both[0] - both[1]), 0.5 * (both[0] + both[1])]


def _rounded(x: Array, y: Array) -> tuple[list[float], ...]:
    """Return a table; what is the same everywhere as its ends alone."""
    # Values that are all the same but for rounding.
    rows = [0, -1] if np.ptp(y) < 1e-12 else slice(None)
    return tuple([float(f"{value:.6g}") for value in each[rows]] for each in (x, y))
