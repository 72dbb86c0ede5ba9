"""`ask_bending`: whether joints bend, asked of the logs of a diagnosis in a wider band."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.bending import Bending, find_bending
from identifiability.bending.rules import RULES
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.findings import phrase
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import Run
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.workflows.case import Case, Data

from .problem import fit_structure
from .result import fit_physical

#: Cut-off of the motion over the band of the torque.
WIDER: Tolerance = 2.5


def ask_bending(case: Case, data: Data, structure: Structure, run: Run) -> Bending:
    """Return what the logs say about joints that bend.

    Parameters
    ----------
    case : Case
    data : Data
        The logs, under their reading.
    structure : Structure
        The robot under the model with the named effects.
    run : Run
    """
    n = len(structure.robot.actuated)
    nothing = Bending((), (), np.nan, np.nan, np.zeros(n), np.zeros(n))
    lost = refuse(structure, data)
    if lost:
        return replace(nothing, lost=lost)
    logs = data.recordings.fitted
    chosen = choose_cutoff(structure.robot, logs, case.preparation)
    found = getattr(chosen, "band", None)
    if found is None:
        return replace(nothing, lost="the logs state accelerations, which hide their own filter")
    step = float(np.median(np.diff(logs[0].t)))
    lowest, highest = RULES.band
    wanted = float(np.clip(RULES.bandwidths * found.bandwidth, lowest, highest))
    # The cut-off stays below half of the sampling rate.
    band = min(wanted, 0.5 / (WIDER * step))
    how = Preparation(cutoff=WIDER * band, outputs=band)
    prepared = case.prepared(structure.robot, data.recordings, how, run)
    bending, stiff = find_bending(
        structure, prepared.fitted, prepared.held_out, band, found.bandwidth
    )
    if bending.joints:
        return fit_elastic(bending, stiff, structure)
    return bending


def fit_elastic(bending: Bending, stiff: Sequence[Dataset], structure: Structure) -> Bending:
    """Return joints that bend, with the physically consistent robot that stands behind them.

    Parameters
    ----------
    bending : Bending
        Its `parameters` are the rotors of these joints.
    stiff : sequence of Dataset
        The logs without the torque of springs and of these rotors.
    structure : Structure
        The robot under the model with the named effects.
    """
    joints = [x.joint for x in bending.joints]
    rotors = dict(bending.parameters)
    if len(rotors) < len(joints) or min(rotors.values()) <= 0.0:
        return replace(bending, parameters={}, rigid=phrase("exported", "rotorless", joints=joints))
    others = [p for p in structure.parameters if p.group == "actuator_inertia"]
    places = "+".join(p.owner for p in others if p.name not in rotors)
    texts = [t for t in structure.model.texts if t.partition("@")[0] != "actuator_inertia"]
    if places:
        texts += [f"actuator_inertia@{places}"]
    model = replace(structure.model, effects=Model.of(*texts).effects)
    rest = Structure.of(structure.robot, model)
    try:
        found = fit_physical(rest, fit_structure(rest, rest.regression(stiff)))
    except IdentifiabilityError as error:
        return replace(bending, parameters={}, rigid=str(error))
    return replace(bending, parameters={**found.values, **rotors})


def refuse(structure: Structure, data: Data) -> str:
    """Return why joints cannot be asked, after "because"; empty if they can."""
    robot = structure.robot
    if robot.closed or robot.couplings:
        return "the robot has loops or coupled joints"
    if robot.base is not None:
        return "the base of the robot floats"
    if data.recordings.commanded:
        return "the torque was computed from commands"
    if robot.torque.has_side("link", "both"):
        return "the torque was measured behind the gears"
    if data.recordings.long:
        return "the logs are too long: give some minutes of them"
    if "rigid_body" not in structure.model.names:
        return "the model has no bodies"
    return ""
