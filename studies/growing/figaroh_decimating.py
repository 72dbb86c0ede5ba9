"""FIGAROH's fit with the decimation of its workflow, alone in a process.

``python -m growing.figaroh_decimating FOLDER``, on samples of `peers.running.make_samples`. Its
workflow builds the regressor of all samples, then low-passes and decimates every column by ten.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from figaroh.identification.identification_tools import relative_stdev
from figaroh.tools.qrdecomposition import QRDecomposer
from figaroh.tools.regressor import (
    build_regressor_basic,
    build_regressor_reduced,
    get_index_eliminate,
)
from peers.figaroh_ways import Robot
from scipy.signal import decimate

#: By how much its workflow decimates.
FACTOR = 10


def main(folder: str) -> None:
    """Fit the samples of a folder."""
    q, v, a, tau = (np.load(Path(folder) / f"{k}.npy") for k in ("q", "v", "a", "tau"))
    robot = Robot((Path(folder) / "robot.txt").read_text(encoding="utf-8"))
    W = build_regressor_basic(robot, q, v, a, robot.settings)
    joints = tau.shape[1]
    rows = W.reshape(joints, len(q), -1)[:, :, : W.shape[1]]
    thin = np.concatenate([decimate(own, FACTOR, axis=0, zero_phase=True) for own in rows])
    torque = np.concatenate([decimate(t, FACTOR, zero_phase=True) for t in tau.T])
    idle, names = get_index_eliminate(thin, robot.parameters, tol_e=1e-3)
    reduced = build_regressor_reduced(thin, idle)
    base, _, _, value = QRDecomposer(tolerance=1e-6).double_decomposition(torque, reduced, names)
    relative_stdev(base, value, torque)


if __name__ == "__main__":
    main(*sys.argv[1:])
