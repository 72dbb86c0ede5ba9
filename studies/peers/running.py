"""Make the samples once, run every contender on them in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory

STUDIES = Path(__file__).resolve().parents[1]

#: Noise on the torque, as a share of each joint's root mean square.
NOISE = 0.01

#: Copies of its regressor that a contender holds at once; larger sizes are not run.
COPIES = {"FIGAROH": 7, "FIGAROH, pivoting": 6, "FIGAROH, physical": 7, "cvxpy, all rows": 25}

#: Share of the free memory that a contender may want.
SHARE = 0.6


@dataclass(frozen=True)
class Measured:
    """One contender on one number of samples; without phases it was not run, and `why` says so.

    Attributes
    ----------
    name : str
    samples : int
    phases : dict of str to [processor, wall] [s]
    imports, peak : float [MB]
        Resident memory with imports alone, and at most.
    evidence : dict
    """

    name: str
    samples: int
    phases: dict[str, list[float]] = field(default_factory=dict)
    imports: float = 0.0
    peak: float = 0.0
    evidence: dict[str, Any] = field(default_factory=dict, repr=False)
    why: str = ""

    @property
    def ran(self) -> bool:
        """Whether there is a result."""
        return bool(self.phases)

    @property
    def seconds(self) -> float:
        """Processor time of all phases [s]."""
        return sum(p[0] for p in self.phases.values())

    def spent(self, phase: str) -> float:
        """Processor time of a phase [s]."""
        return self.phases[phase][0]


@contextmanager
def make_samples(count: int, seed: int) -> Iterator[Path]:
    """Give a folder with motion and torque of the shipped six-axis arm.

    Torque is Pinocchio's inverse dynamics with the file's values, with the file's friction, and
    white noise.
    """
    robot = Robot.load("six-dof-arm")
    move = PrescribedMotion.of(shipped_trajectory(robot, "a"), count)
    model = pin.buildModelFromUrdf(str(robot.path))
    data = model.createData()
    tau = np.array(
        [pin.rnea(model, data, *row) for row in zip(move.q, move.dq, move.ddq, strict=True)]
    )
    for k, joint in enumerate(robot.joints):
        rate = move.dq[:, k]
        tau[:, k] += robot.nominal[f"{joint}.Fv"] * rate
        tau[:, k] += robot.nominal[f"{joint}.Fc"] * np.sign(rate)
    size = np.sqrt(np.mean(tau**2, axis=0))
    tau += NOISE * size * np.random.default_rng(seed).standard_normal(tau.shape)
    with TemporaryDirectory() as folder:
        for name, values in zip("tqva", (move.t, move.q, move.dq, move.ddq), strict=True):
            np.save(Path(folder) / f"{name}.npy", values)
        np.save(Path(folder) / "tau.npy", tau)
        (Path(folder) / "robot.txt").write_text(str(robot.path), encoding="utf-8")
        yield Path(folder)


def run_contender(name: str, folder: Path, count: int, repeats: int, most: float) -> Measured:
    """Run a contender some times, each in a new process, and return the fastest.

    Parameters
    ----------
    name : str
    folder : Path
        From `make_samples`.
    count : int
        Samples in it.
    repeats : int
    most : float [s]
        A run that takes longer is ended.
    """
    if name.startswith("FIGAROH") and find_spec("figaroh") is None:
        return Measured(name, count, why="FIGAROH is not installed (the extra `bench`)")
    need, free = 72 * 6 * 8 * count * COPIES.get(name, 0) / 1e6, free_memory()
    if need > SHARE * free:
        why = (
            f"it would need about {need / 1e3:.0f} GB; of the {free / 1e3:.0f} GB that are free "
            f"{100 * SHARE:.0f} % may be used"
        )
        return Measured(name, count, why=why)
    best: Measured | None = None
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    path = os.pathsep.join([str(STUDIES), str(STUDIES.parent), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "peers.process", name, str(folder)]
    for _ in range(repeats):
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=most, check=False,
                env=os.environ | one | {"PYTHONPATH": path},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Measured(name, count, why=f"it was ended after {most:.0f} s")
        if done.returncode:
            last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            return Measured(name, count, why=f"it failed: {last[:200]}")
        now = Measured(name, count, **json.loads(done.stdout.splitlines()[-1]))
        best = now if best is None or now.seconds < best.seconds else best
    assert best is not None
    return best


def free_memory() -> float:
    """Return the memory that is free on this machine [MB]."""
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable"):
            return int(line.split()[1]) / 1024
    return float("inf")
