"""Torque columns that hold magnitudes: the sign of the torque was lost before it was logged."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.logs.commands import of_commands
from identifiability.logs.rules import RULES

from .registry import Does, MeasuredLogs, check

#: Rounds in which signs and values are found in turns.
ROUNDS = 30


@check("magnitude", Does.MISREADS)
def find_magnitudes(logs: MeasuredLogs) -> list[Finding]:
    """Return torque columns that are never negative, and that a torque of both signs explains."""
    measured = [log.shown.tau for log in logs.recordings if not of_commands(log)]
    never_negative = np.all([(tau >= 0).all(0) for tau in measured], axis=0)
    joints = np.flatnonzero(never_negative).tolist() if measured else []
    if not joints:
        return []
    columns = logs.structure.model.regressor(logs.robot, logs.motion)
    names = [
        f"{logs.joints[j]}.tau"
        for j in joints
        if is_magnitude(columns[:, j], logs.torque[:, j], logs.predicted[:, j])
    ]
    return [Finding("magnitude", columns=names)] if names else []


def is_magnitude(columns: Array, torque: Array, predicted: Array) -> bool:
    """Return whether a signed torque has at most half the squared residual of an unsigned one.

    Parameters
    ----------
    columns : (N, p)
        Of the parameters of the model.
    torque : (N,) [N·m or N]
        Torque without negative values.
    predicted : (N,) [N·m or N]
        Torque by the masses of the file. The search starts from its signs.
    """
    size = np.linalg.norm(columns, axis=0)
    Q, R = np.linalg.qr(columns[:, size > 0] / size[size > 0])
    Q = Q[:, np.abs(np.diag(R)) > RULES.negligible]
    signed = np.where(predicted < 0, -torque, torque)
    for _ in range(ROUNDS):
        signed = np.where(Q @ (Q.T @ signed) < 0, -torque, torque)
    return bool(residual_square(Q, signed) < 0.5 * residual_square(Q, torque))


def residual_square(basis: Array, torque: Array) -> float:
    """Return the sum of squared residuals of torque (N,) after projection on a basis (N, k)."""
    rest = torque - basis @ (basis.T @ torque)
    return float(rest @ rest)
