"""Run a command as a user would, and say what it took."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

#: BLAS threads fight over small matrices, and processor time is to be that of one. What is
#: installed was compiled once, whatever this environment says: empty is as if it said nothing.
ONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
ONE |= {"PYTHONDONTWRITEBYTECODE": ""}

STUDIES = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Took:
    """What a command took of a machine.

    Attributes
    ----------
    who : str
    what : str
        What grows: samples, diagnosed samples, joints, logs or replicates.
    size : int
        How much of that.
    cpu : float
        Processor time of the process and those it started, imports included [s].
    peak : float
        Largest resident memory of one process [MB].
    """

    who: str
    what: str
    size: int
    cpu: float
    peak: float


def run(who: str, what: str, size: int, argv: Sequence[str]) -> Took | None:
    """Run ``python argv…`` and return what it took; None where it fails, with its last words."""
    path = os.pathsep.join([str(STUDIES), str(STUDIES.parent), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | ONE | {"PYTHONPATH": path}
    null = os.open(os.devnull, os.O_WRONLY)
    child = os.posix_spawn(
        sys.executable,
        [sys.executable, *argv],
        environment,
        file_actions=[(os.POSIX_SPAWN_DUP2, null, 1), (os.POSIX_SPAWN_DUP2, null, 2)],
    )
    os.close(null)
    _, status, used = os.wait4(child, 0)
    if status:
        print(f"{who}, {size} {what}: failed ({' '.join(argv)})", flush=True)
        return None
    took = Took(who, what, size, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3)
    print(f"{who}, {size} {what}: {took.cpu:.2f} s, {took.peak:.0f} MB", flush=True)
    return took


def exponent(sizes: Sequence[int], values: Sequence[float]) -> float:
    """Return e of ``a + b size^e``, a being what the smallest takes; NaN of fewer than three.

    Starting Python costs the same at every size: the exponent is that of what comes on top.
    """
    if len(sizes) < 3:
        return float("nan")
    more = np.array(values[1:]) - values[0]
    if not (more > 0).all():
        return 0.0
    return float(np.polyfit(np.log(sizes[1:]), np.log(more), 1)[0])
