"""A tilted base in a diagnosis: gravity's direction, about which everything is fitted once more.

A large tilt is found before all else, since about the file's direction it looks like much that it
is not: the diagnosis is then of the model under the gravity that was found, and the tilt is the
first of its names. A small one is a name like others; its direction is settled at the end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects.gravity import TILTS, GravityTilt, horizontal_axes
from identifiability.effects.nominal import gravity_torque
from identifiability.effects.registry import title_of
from identifiability.estimation.estimate import estimate
from identifiability.estimation.prediction import Prediction, predict
from identifiability.foundation.names import BASE
from identifiability.logs.prepare import Samples
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot.kinematics import shortest_turn
from identifiability.workflows.diagnose.findings import NamedEffect, Placement, Shown
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.gravity import Leaning, settle_tilt


def settle_named(found: Diagnosis) -> Diagnosis:
    """Return a diagnosis that names a small tilt with gravity's direction in its model."""
    if found.fixed or not any(e.name == GravityTilt.name for e in found.effects):
        return found
    model = found.model
    others = Model(tuple(e for e in model.effects if e.name != GravityTilt.name))
    known = Structure.of(found.structure.robot, others)
    leaning = settle_tilt(known, found.samples)
    if leaning is None:
        return found
    effects = tuple(
        replace(e, leaning=leaning) if e.name == GravityTilt.name else e for e in found.effects
    )
    last = next(e for e in leaning.structure.model.effects if e.name == GravityTilt.name)
    return replace(found, effects=effects, model=Model((*others.effects, last)))


def lead_with_tilt(
    found: Diagnosis,
    upright: Structure,
    leaning: Leaning,
    p_value: float,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return a diagnosis under the gravity that was found as one of the robot file's.

    Parameters
    ----------
    found : Diagnosis
        Of the model about that gravity.
    upright : Structure
        What was diagnosed, with gravity as the file states it.
    leaning : Leaning
    p_value : float
        The smallest that as many simulated noises can give.
    rng : numpy.random.Generator
    """
    fitted, unseen = _left(upright, found.samples, found.validation)
    gap = Gap(found.gap.rows, np.concatenate([unseen.residual, found.gap.residual], axis=2))
    errors, joints = gap.relative_error().tolist(), gap.error_over_joints().tolist()
    interval, own = gap.interval(0, 1, rng), gap.interval_over_joints(0, 1, rng)
    shown = Shown(joints[0], joints[1], own, gap.expected_change(0, 1))
    first = NamedEffect(
        name=GravityTilt.name,
        title=title_of(GravityTilt.name),
        placements=(_place(found, upright, leaning, p_value),),
        before=errors[0],
        after=errors[1],
        interval=interval,
        joints_before=joints[0],
        joints_after=joints[1],
        joints_interval=own,
        shown=shown,
        leaning=leaning,
    )
    return replace(
        found,
        upright=upright,
        effects=(first, *found.effects),
        gap=gap,
        interval=gap.interval(0, -1, rng),
        held_before=errors[0],
        error_before=float(fitted.relative_error()[0]),
        real_before=float("nan"),
        real_after=float("nan"),
    )


def _left(
    structure: Structure, samples: tuple[Samples, ...], validation: tuple[Samples, ...]
) -> tuple[Prediction, Prediction]:
    """Return what a model predicts on the logs that it was fitted to, and on unseen ones."""
    fitted = structure.regression(samples)
    values = estimate(gather_information(fitted)).value[:, None]
    return predict(fitted, values), predict(structure.regression(validation), values)


def _place(found: Diagnosis, upright: Structure, leaning: Leaning, p_value: float) -> Placement:
    """Return a tilt as two rotations of gravity about horizontal axes of the file."""
    stated, turned = upright.robot, leaning.structure.robot
    step = shortest_turn(stated.gravity, turned.gravity)
    motion = found.samples[0].motion
    added = gravity_torque(turned, motion, turned.gravity)
    added = added - gravity_torque(stated, motion, stated.gravity)
    return Placement(
        place=BASE,
        shape=float("nan"),
        p_value=p_value,
        parameters=tuple(f"{BASE}.{kind}" for kind in TILTS),
        units=("rad", "rad"),
        values=np.array([axis @ step for axis in horizontal_axes(stated.gravity)]),
        errors=np.full(2, np.radians(leaning.sd)),
        rms=float(np.sqrt(np.mean(added**2, axis=0)).max()),
        rivals=(),
    )
