"""One contender, alone in a process: load the samples, run it, print the measurements.

``python -m peers.process NAME FOLDER``. Each contender is a function in a separate module, so that
only its imports are loaded; that happens before the clock starts.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

Array = Any

#: Samples at which the answers of contenders are compared.
COMPARED = 200

#: Where contenders are, by name.
CONTENDERS = {
    "bare loop": ("peers.bare", "fill"),
    "ours": ("peers.ours", "fit"),
    "FIGAROH": ("peers.figaroh_ways", "fit_double"),
    "FIGAROH, pivoting": ("peers.figaroh_ways", "fit_pivoting"),
    "ours, physical": ("peers.ours_physical", "fit"),
    "FIGAROH, physical": ("peers.figaroh_physical", "fit"),
    "cvxpy, all rows": ("peers.cvxpy_rows", "fit"),
}


@dataclass
class Run:
    """Samples in; phases and evidence out.

    Attributes
    ----------
    robot : str
        URDF file.
    t : (N,) [s]
    q, v, a, tau : (N, n)
    phases : dict of str to (processor, wall) [s]
    evidence : dict
        What must agree between contenders.
    peak : float [MB]
        Largest memory up to the end of the last phase.
    """

    robot: str
    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    phases: dict[str, tuple[float, float]] = field(default_factory=dict)
    evidence: dict[str, Any] = field(default_factory=dict)
    peak: float = 0.0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a phase."""
        wall, processor = time.perf_counter(), time.process_time()
        yield
        self.phases[name] = time.process_time() - processor, time.perf_counter() - wall
        self.peak = memory()

    @property
    def shown(self) -> np.ndarray:
        """Samples at which answers are compared."""
        return np.unique(np.linspace(0, len(self.q) - 1, COMPARED).astype(int))

    @property
    def shown_by_joint(self) -> np.ndarray:
        """Rows of the shown samples where all samples of a joint stand together, (S, n)."""
        return self.shown[:, None] + len(self.q) * np.arange(self.q.shape[1])

    def show_fit(self, W: Array, value: Array, covariance: Array, variance: float) -> None:
        """Keep torque, its deviation and the noise, which no choice of base parameters changes.

        Parameters
        ----------
        W : (S, n, b)
            Rows of the base regressor at the shown samples.
        value, covariance : (b,), (b, b)
        variance : float [torque²]
        """
        spread = np.sqrt(np.einsum("snb,bc,snc->sn", W, covariance, W))
        self.evidence |= {
            "rank": len(value),
            "variance": variance,
            "torque": (W @ value).tolist(),
            "torque_sd": spread.tolist(),
        }


def memory() -> float:
    """Return the largest resident memory so far [MB]."""
    status = Path("/proc/self/status")
    if status.is_file():  # getrusage would count the process that started this one
        lines = status.read_text(encoding="ascii").splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main(name: str, folder: str) -> None:
    """Run one contender on the samples of a folder and print the measurements."""
    module, function = CONTENDERS[name]
    contender = getattr(import_module(module), function)
    imports = memory()
    arrays = [np.load(Path(folder) / f"{k}.npy") for k in ("t", "q", "v", "a", "tau")]
    run = Run((Path(folder) / "robot.txt").read_text(encoding="utf-8"), *arrays)
    contender(run)
    result = {"phases": run.phases, "imports": imports, "peak": run.peak, "evidence": run.evidence}
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
