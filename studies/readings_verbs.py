"""The matrix of `readings.py`: errors of verbs on logs with a fault, over those on sound ones.

A two-link arm is logged with a fault. Each verb gets these logs, and the same data read right. An
error counts by its ratio. A value counts by its ratio, or the inverse of that, whichever is larger.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from hidden_physics import add_mass, torque_between
from readings_faults import Drawn, Logged, draw, plant_fault, under_gravity

from identifiability import (
    Analysis,
    Robot,
    analyze,
    calibrate,
    compare,
    diagnose,
    excite,
    export,
    payload,
    predict,
    prune,
)
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array

#: Faults of the matrix, and the arm that has them.
KINDS = (
    "columns exchanged", "sign of all", "unit of one", "delay of all", "on its side",
    "gravity removed", "uint16",
)  # fmt: skip
ARM, NUMBER = "two-link", 2
#: The log of which the machine has changed, and the sealed one.
CHANGED, SEALED = 3, 4
#: What changes: a load over the mass of the last body, and dry friction of the last joint.
LOAD, FRICTION = 0.5, 0.6
#: Motions that `excite` looks at, and repetitions of `calibrate`.
EVALUATIONS, REPEATED = 200, 24


@dataclass
class Subject:
    """Logs of one arm, with the fault or read right, and the figures of verbs on them.

    Attributes
    ----------
    loaded, worn : Logged
        With a load in the log `CHANGED`, and with more friction there.
    path : Path
        Folder of the files.
    true : bool
        Whether the logs are read right.
    """

    loaded: Logged
    worn: Logged
    path: Path
    true: bool

    def files(self, logged: Logged, name: str) -> tuple[Robot, dict[int, Path]]:
        """Write logs; return the robot as it is stated, and the paths of the logs."""
        used = [*range(logged.fitted), CHANGED, SEALED]
        file, paths = logged.write(self.path / name, true=self.true, logs=used)
        robot = Robot.load(file)
        robot = under_gravity(robot, logged.true_gravity) if self.true else robot
        return robot, dict(zip(used, paths, strict=True))

    @cached_property
    def logs(self) -> tuple[Robot, dict[int, Path]]:
        """The robot and the logs; one log has the load."""
        return self.files(self.loaded, "loaded")

    @property
    def robot(self) -> Robot:
        """The robot, as it is stated."""
        return self.logs[0]

    @property
    def fitted(self) -> list[Path]:
        """Logs that are fitted."""
        return [self.logs[1][k] for k in range(self.loaded.fitted)]

    @property
    def sealed(self) -> Path:
        """The log that scores."""
        return self.logs[1][SEALED]

    @cached_property
    def analysis(self) -> Analysis:
        """Analysis of the logs."""
        return analyze(self.robot, self.fitted, "none", replicates=0)

    @cached_property
    def result(self) -> Path:
        """The same in a file."""
        return self.analysis.to_json(self.path / "result.json")

    def column_error(self, prediction: Any) -> float:
        """Return the error of a prediction in the columns of the log, over sound variation."""
        p = getattr(prediction, "as_logged", prediction)
        known = p.known & np.isfinite(p.tau)
        square = (np.where(known, p.tau - p.predicted, 0.0) ** 2).sum(0) / known.sum(0)
        right = self.loaded.right
        holds = np.argsort(right.order)
        unit = np.ones(len(holds)) if self.true else 1.0 / right.factor[holds]
        scale = self.loaded.drawn.tau[SEALED].std(0)
        scale = scale if self.true else scale[holds]
        return float(np.sqrt(np.mean(square / (unit * scale) ** 2)))


def by_analyze(x: Subject) -> float:
    """Return the error of the model of `analyze` on the sealed log."""
    held_out = analyze(x.robot, x.fitted, x.sealed, replicates=0)
    return held_out.chosen.error_ra_validation


def by_diagnose(x: Subject) -> float:
    """Return the error of the completed model on the sealed log."""
    found = diagnose(x.robot, x.fitted, forward=False)
    return x.column_error(found.predict([x.sealed]))


def by_prune(x: Subject) -> float:
    """Return the error of the pruned model on the sealed log."""
    found = prune(x.robot, x.fitted, "none", quick=True)
    return x.column_error(found.predict([x.sealed]))


def by_predict(x: Subject) -> float:
    """Return the error of a prediction by a result from a file."""
    return x.column_error(predict(x.robot, x.result, x.sealed))


def by_payload(x: Subject) -> float:
    """Return the mass of the load [kg]."""
    return payload(x.robot, x.analysis, x.logs[1][CHANGED]).mass.value


def by_compare(x: Subject) -> float:
    """Return the size of the change of friction [N·m]."""
    robot, logs = x.files(x.worn, "worn")
    before = [logs[k] for k in range(x.worn.fitted)]
    found = compare(robot, before, logs[CHANGED])
    name = f"{robot.joints[-1]}.Fc"
    sizes = [change.sizes[0] for change in found.changes if name in change.names]
    return float(sizes[0]) if sizes else float("nan")


def by_export(x: Subject) -> float:
    """Return the error of the exported file on the sealed log."""
    if not x.robot.gravity.any():  # no file can state that: the model counts
        return by_analyze(x)
    out = x.path / "exported.urdf"
    out.unlink(missing_ok=True)
    found = export(x.robot, x.result, out, validate=x.sealed, force=True)
    return float(found.unseen.both)


def by_calibrate(x: Subject) -> float:
    """Return the coverage of the intervals."""
    return calibrate(x.analysis, replicates=REPEATED, refits=20).cell.coverage


def by_excite(x: Subject) -> float:
    """Return the figure of the motion that excitation finds in addition to the logs."""
    found = excite(x.robot, start_from=x.fitted, evaluations=EVALUATIONS)
    return float(np.exp(found.after.figure / len(found.names)))


#: Verbs, and whether their answers are errors, of which less is better.
VERBS: dict[str, tuple[Callable[[Subject], float], bool]] = {
    "analyze": (by_analyze, True),
    "diagnose": (by_diagnose, True),
    "prune": (by_prune, True),
    "predict": (by_predict, True),
    "payload": (by_payload, False),
    "compare": (by_compare, False),
    "export": (by_export, True),
    "calibrate": (by_calibrate, False),
    "excite": (by_excite, False),
}


def change_machine(drawn: Drawn, gravity: Array) -> tuple[Drawn, Drawn]:
    """Return draws with a load, and with more friction, in the log `CHANGED`.

    Parameters
    ----------
    drawn : Drawn
    gravity : (3,) [m/s²]
        That weighs the load: none where a controller takes off the weight of robot and load.
    """
    runs, last = drawn.runs, drawn.case.n - 1
    bare = drawn.case.machine.model.__copy__()
    bare.opt.gravity[:] = gravity
    machine = replace(drawn.case.machine, model=bare)
    body = bare.nbody - 1
    loaded = add_mass(bare, body, LOAD * float(bare.body_mass[body]), 2 * bare.body_ipos[body])
    taken = np.zeros_like(runs.tau)
    taken[CHANGED] = torque_between(machine, loaded, runs)[CHANGED]
    rubbed = np.zeros_like(runs.tau)
    rubbed[CHANGED, :, last] = FRICTION * machine.dry[last] * np.sign(runs.v[CHANGED, :, last])
    torques = (runs.tau + taken, runs.tau + rubbed)
    loaded_draw, worn_draw = (replace(drawn, runs=replace(runs, tau=tau)) for tau in torques)
    return loaded_draw, worn_draw


def measure(kind: str, verbs: Sequence[str], stream: str, folder: Path) -> dict[str, float | str]:
    """Return the answers of verbs on logs with a fault over those on the data read right."""
    drawn = draw(stream, NUMBER, ARM)
    gravity = plant_fault(drawn, kind).true_gravity
    loaded, worn = (plant_fault(changed, kind) for changed in change_machine(drawn, gravity))
    subjects = [
        Subject(loaded, worn, folder / name, true=name == "right") for name in ("read", "right")
    ]
    out: dict[str, float | str] = {"fault": kind}
    for verb in verbs:
        answer, is_error = VERBS[verb]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                read, right = (answer(subject) for subject in subjects)
        except IdentifiabilityError as refusal:
            out[verb] = f"refused: {refusal}"[:100]
            continue
        ratio = read / right
        out[verb] = ratio if is_error else max(ratio, 1.0 / ratio)
        print(f"{kind}, {verb}: {read:.4g} over {right:.4g}", flush=True)
    return out
