"""Evaluate an exported robot file with other engines along the motion that was fitted."""

import json
from dataclasses import dataclass

import numpy as np

from identifiability import Dataset, Model, Preparation, Regression, Robot, export, prepare_log
from identifiability.effects import FAMILIES

from ..roads import in_mujoco, in_pinocchio, project


def error_ra(tau, predicted):
    return np.abs(predicted - tau).sum() / np.abs(tau - tau.mean()).sum()


@dataclass
class Replayed:
    """Errors that other roads find on the exported files, along the fitted log."""

    stated: dict
    exported: object
    robot: Robot
    whole: float
    mujoco: float
    pinocchio: float = np.nan


def fitted_samples(copy, result, log):
    """The log along which errors were stated: as measured, or a series through it."""
    kinds = {"Fourier": "fourier", "a spline": "spline"}
    note = result.samples[0].notes[0]
    kind = next((kind for word, kind in kinds.items() if word in note), "auto")
    return prepare_log(copy, log, Preparation(kind))


ENGINES = {"mujoco": in_mujoco, "pinocchio": in_pinocchio}


def torque_outside(exported, copy, samples):
    """Return measured torque and that of the file by each engine, where torque is data."""
    found = {"measured": []}
    for piece in samples.pieces(4096):  # a joint that stands is no data
        found["measured"].append(piece.down(piece.silenced(np.array(piece.tau)))[piece.moves])
        for name, engine in ENGINES.items():
            tree = engine(exported.robot, copy, piece.motion)
            if tree is not None:  # of springs, cables and motors of tendons Pinocchio knows nothing
                torque = piece.silenced(project(copy, piece.motion, tree))
                found.setdefault(name, []).append(piece.down(torque)[piece.moves])
    return {name: np.concatenate(parts) for name, parts in found.items()}


def torque_model(robot):
    """Return the model of all that a file and its sidecar say, and its values."""
    every = Model(tuple(f.effect for f in FAMILIES.values() if f.name != "coulomb_friction"))
    return every, np.array([robot.nominal.get(p.name, 0.0) for p in every.parameters(robot)])


def replay(robot, result, log, folder):
    """Export a result and evaluate file, and file with sidecar, on the log."""
    path = result.to_json(folder / "result.json")
    exported = export(robot, path, folder / f"fitted{robot.path.suffix}", force=True)
    copy = Robot.load(exported.robot)
    samples = log if isinstance(log, Dataset) else fitted_samples(copy, result, log)
    every, phi = torque_model(copy)
    chunks = Regression(copy, every, (samples,)).chunks()
    found = torque_outside(exported, copy, samples)
    found["whole"] = np.concatenate([(c.W @ phi)[c.data] for c in chunks])
    tau = found.pop("measured")
    errors = {name: error_ra(tau, x) for name, x in found.items()}
    stated = json.loads(path.read_text())["physical"]
    return Replayed(stated, exported, copy, **errors)
