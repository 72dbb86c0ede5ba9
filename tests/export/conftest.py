"""Evaluate an exported robot file with other engines along the motion that was fitted."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

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
    mujoco: float
    pinocchio: float
    whole: float


def fitted_samples(copy, result, log):
    """The log along which errors were stated: as measured, or a series through it."""
    kinds = {"Fourier": "fourier", "a spline": "spline"}
    note = result.samples[0].notes[0]
    kind = next((kind for word, kind in kinds.items() if word in note), "auto")
    return prepare_log(copy, log, Preparation(kind))


def replay(robot, result, log, folder):
    """Export a result and evaluate file, and file with sidecar, on the log."""
    path = result.to_json(folder / "result.json")
    exported = export(robot, path, folder / f"fitted{robot.path.suffix}", force=True)
    copy = Robot.load(exported.robot)
    samples = log if isinstance(log, Dataset) else fitted_samples(copy, result, log)
    alone = {}
    for piece in samples.pieces(4096):
        alone.setdefault("tau", []).append(piece.down(piece.tau))
        alone.setdefault("data", []).append(piece.weight[piece.at] > 0)
        for engine in (in_mujoco, in_pinocchio):
            tree = engine(exported.robot, copy, piece.motion)
            tree = np.full((len(piece.tau), copy.nv), np.nan) if tree is None else tree
            alone.setdefault(engine, []).append(piece.down(project(copy, piece.motion, tree)))
    data = np.concatenate(alone["data"])  # a joint that stands is none
    tau = np.concatenate(alone["tau"])[data]
    errors = [error_ra(tau, np.concatenate(alone[e])[data]) for e in (in_mujoco, in_pinocchio)]
    every = Model(tuple(f.effect for f in FAMILIES.values() if f.name != "coulomb_friction"))
    names = [p.name for p in every.parameters(copy)]
    phi = np.array([copy.nominal.get(name, 0.0) for name in names])
    fitted = [c.W @ phi for c in Regression(copy, every, (samples,)).chunks()]
    whole = error_ra(tau, np.concatenate(fitted)[data])
    stated = json.loads(path.read_text())["physical"]
    return Replayed(stated, exported, copy, *errors, whole)


@pytest.fixture(scope="session")
def replayed():
    """A function (robot, result, log, folder) -> Replayed."""
    return replay
