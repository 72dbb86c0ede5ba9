"""Torque columns that hold magnitudes: the sign of the torque was lost before it was logged."""

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import minimum_filter1d

from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import rms_of
from identifiability.foundation.names import Array, name_each
from identifiability.foundation.rules import Tolerance
from identifiability.logs.rules import RULES

from .registry import Does, MeasuredLogs, check

#: Share of its root mean square below which a magnitude is near zero, and samples in which it is
#: the least there.
NEAR_ZERO: Tolerance = 0.3
NEIGHBOURS = 5


@check("magnitude", Does.MISREADS)
def find_magnitudes(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield torque columns that may be magnitudes, and that a torque of both signs explains."""
    joints = np.flatnonzero(may_be_magnitudes(logs)).tolist()
    if not joints:
        return
    columns = logs.structure.model.regressor(logs.robot, logs.motion)
    names = [
        f"{logs.joints[j]}.tau"
        for j in joints
        if is_magnitude(columns[:, j], logs.torque[:, j], logs.predicted[:, j])
    ]
    if names:
        yield Finding("magnitude", columns=names)


def may_be_magnitudes(logs: MeasuredLogs) -> Array:
    """Return whether the torque column of each joint is never negative, but nearly zero, (n,)."""
    if not logs.measured:
        return np.zeros(len(logs.joints), bool)
    least = np.min([log.tau.min(0) for log in logs.measured], axis=0)
    most = np.max([log.tau.max(0) for log in logs.measured], axis=0)
    found = (least >= 0) & (least < RULES.small * most)
    by_joint = name_each(logs.measured[0].joints, found)
    return np.array([by_joint.get(joint, False) for joint in logs.joints])


def is_magnitude(columns: Array, torque: Array, predicted: Array) -> bool:
    """Return whether a signed torque has a at most half the squared residual of an unsigned one.

    A torque changes its sign where its magnitude comes near zero. So the sign of each section
    between two such places is sought, first from the signs of the prediction, then from one sign.

    Parameters
    ----------
    columns : (N, p)
        Of the parameters of the model.
    torque : (N,) [N·m or N]
        Torque without negative values.
    predicted : (N,) [N·m or N]
        Torque by the masses of the file.
    """
    size = np.linalg.norm(columns, axis=0)
    Q, R = np.linalg.qr(columns[:, size > 0] / size[size > 0])
    Q = Q[:, np.abs(np.diag(R)) > RULES.negligible]
    sections = split_at_zeros(torque)
    residuals = []
    for start in (np.where(predicted < 0, -torque, torque), torque):
        signs = choose_signs(Q, sections, np.sign(sections.T @ start))
        residuals.append(residual_square(Q, sections @ signs))
    return bool(min(residuals) < 0.5 * residual_square(Q, torque))


def split_at_zeros(torque: Array) -> Array:
    """Return torque (N,) as a sum of its sections between minima near zero, (N, sections)."""
    near_zero = torque < NEAR_ZERO * rms_of(torque)
    least = torque <= minimum_filter1d(torque, NEIGHBOURS)
    section = np.cumsum(near_zero & least)
    split = np.zeros((len(torque), section[-1] + 1))
    split[np.arange(len(torque)), section] = torque
    return split


def choose_signs(basis: Array, sections: Array, signs: Array) -> Array:
    """Return the signs (k,) of sections (N, k) from which no change of one lowers the residual."""
    rest = sections - basis @ (basis.T @ sections)
    gram = rest.T @ rest
    signs = np.where(signs < 0, -1.0, 1.0)
    while True:
        change = np.diag(gram) - signs * (gram @ signs)
        best = int(np.argmin(change))
        if change[best] > -RULES.negligible * float(np.trace(gram)):
            return signs
        signs[best] = -signs[best]


def residual_square(basis: Array, torque: Array) -> float:
    """Return the sum of squared residuals of torque (N,) after projection on a basis (N, k)."""
    rest = torque - basis @ (basis.T @ torque)
    return float(rest @ rest)
