"""Gains of servos that nobody states: found from logs of commands, and what fixes their scale.

Commands and positions tell ratios alone: gains, rotors, friction and bodies that are all twice as
large move alike. The scale comes from what is known beside the logs: bodies within a share of the
robot file's, or what its sidecar states of single ones (``[prior_share]``, ``[prior]``). Bodies are
fitted beside the gains in coordinates in which each stays a possible one, J = P (1 + E)(1 + E)ᵀ Pᵀ
with E upper triangular and J₀ = P Pᵀ the file's pseudo-inertia.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.estimation.rollouts import Gains, contradicted, fit_gains, share_missed
from identifiability.foundation.errors import LogError, RobotError, listing
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.commands import check_commands
from identifiability.logs.contradictions import check_units
from identifiability.logs.conventions import Conventions
from identifiability.physical.cad_prior import thick_inertia
from identifiability.physical.pseudo_inertia import BASIS
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.robot import Robot
from identifiability.robot.servo import FOUND
from identifiability.workflows.opening import Logs, in_memory, list_logs, read_recordings

#: Length of logs that gains are found from, all together [s]: more says little more of them.
LONG: Tolerance = 60.0


_UPPER = np.triu_indices(4)


@frozen
class Bodies:
    """Bodies that are a robot file's within shares, as `estimation.rollouts.Believed`.

    Attributes
    ----------
    robot : Robot
    share : float
        Within which a body is the file's, where its sidecar does not say otherwise.
    """

    robot: Robot
    share: float = PHYSICAL_RULES.body_within

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Bodies whose inertia the file states."""
        nominal = self.robot.nominal
        return tuple(b for b in self.robot.bodies if nominal.get(f"{b}.m", 0.0) > 0)

    @property
    def bodies(self) -> tuple[str, ...]:
        """The body of each coordinate."""
        return tuple(b for b in self.names for _ in range(len(_UPPER[0])))

    @cached_property
    def _roots(self) -> list[Array]:
        nominal = self.robot.nominal
        each = [np.array([nominal[f"{b}.{k}"] for k in GROUPED_KINDS]) for b in self.names]
        pairs = zip(self.names, each, strict=True)
        return [np.linalg.cholesky(thick_inertia(x, b)) for b, x in pairs]

    @property
    def shares(self) -> Array:
        """Within which each body is the file's, (nb,)."""
        return np.array([self.robot.said.prior_share.get(b, self.share) for b in self.names])

    def values(self, e: Array) -> dict[str, float]:
        """Return standard parameters at some coordinates, ten of each body (m,)."""
        out: dict[str, float] = {}
        for body, P, own in zip(self.names, self._roots, e.reshape(-1, 10), strict=True):
            E = np.eye(4)
            E[_UPPER] += own
            J = P @ E @ E.T @ P.T
            phi = np.linalg.lstsq(BASIS.reshape(10, 16).T, J.ravel(), rcond=None)[0]
            out |= dict(zip((f"{body}.{k}" for k in GROUPED_KINDS), phi.tolist(), strict=True))
        return out

    def scaled(self, e: Array, by: float) -> Array:
        """Return the coordinates of bodies that are so many times as heavy and alike."""
        one = np.tile(np.eye(4)[_UPPER], len(self.names))
        return np.asarray(np.sqrt(by) * (one + e) - one)

    def rows(self, e: Array, numbers: Mapping[str, Array]) -> Array:
        """Return how far bodies and stated parameters are from what is believed, (r,) [σ]."""
        near = (e.reshape(-1, 10) / self.shares[:, None]).ravel()
        joints = {
            f"{joint}.{self.robot.inertia_parts[0] if kind == 'Ia' else kind}": x
            for kind, values in numbers.items()
            for joint, x in zip(self.robot.joints, values, strict=True)
        }
        found = {**(self.values(e) if self._stated else {}), **joints}
        return np.array([*near, *((found[k] - m) / s for k, (m, s) in self._stated.items())])

    @cached_property
    def _stated(self) -> dict[str, tuple[float, float]]:
        joints = {f"{j}.{k}" for j in self.robot.joints for k in ("Ia", "Ja", "Fv", "Fc", "off")}
        known = {f"{b}.{k}" for b in self.names for k in GROUPED_KINDS} | joints
        return {name: at for name, at in self.robot.prior.items() if name in known}


def read_moving(robot: Robot, logs: Logs) -> tuple[list[Log], tuple[str, ...]]:
    """Return logs that commands moved, or else torque, and what was mended in them.

    They are in the robot's order of joints, and have every motion, those that come again, too.

    Raises
    ------
    LogError
        If the motion contradicts the commands.
    """
    # Torque beside commands is not looked at.
    known = replace(Conventions.of(robot), commands=robot.servo is not None)
    given = read_recordings(logs, known=known, commands=True, learns=False)
    return _select(robot, in_memory(given.fitted)), given.hints


def _select(robot: Robot, logs: Iterable[Log]) -> list[Log]:
    """Return logs in the robot's order of joints, if the motion does not contradict them."""
    own = [log.select(robot.joints) for log in logs]
    for log in own:
        check_commands(log)
        check_units(robot, [log])
    return own


def find_gains(robot: Robot, logs: Logs) -> Robot:
    """Return a robot whose servos have gains; logs of commands alone tell those nobody states.

    Raises
    ------
    LogError
        If no gains make it follow.
    RobotError
        If it cannot be rolled out.
    """
    if not list_logs(logs):
        return robot
    given = read_recordings(logs, known=Conventions.of(robot), commands=True, learns=False)
    alone = [x for x in given.fitted if isinstance(x, Log) and x.commanded and x.motion_alone]
    return learn_gains(robot, _select(robot, alone))


def learn_gains(robot: Robot, logs: Sequence[Log]) -> Robot:
    """Return a robot with gains that logs with commands tell, as `find_gains`."""
    every = [log for log in logs if log.q_ref is not None]
    if robot.servo is None or not (every and robot.servo.unknown.any()):
        return robot
    each = LONG / len(every)
    parts = [x.rows(0, min(len(x), round(each / signals.sampling_step(x.t)))) for x in every]
    believed = Bodies(robot)
    if not believed.names:
        raise RobotError(
            f"{robot.path} states no body with mass, and gains that nobody states have no scale "
            "without one; state masses, or one gain in the sidecar ([servo] kp = …)."
        )
    found = fit_gains(robot, parts, believed)
    share = share_missed(found.errors, parts)
    k = int(np.argmax(share))
    if contradicted(share):  # of a single joint rollouts with these gains tell
        raise LogError(
            f"No gains make '{robot.joints[k]}' follow its commands in "
            f"{listing([x.name for x in every], 4)}: at best it errs by {100 * share[k]:.0f} % of "
            "how far it is from them, merely delayed; check the sign and zero of its command, and "
            "that its servo holds positions."
        )
    values, axes = np.linalg.eigh(found.covariance)
    doubt = (np.sqrt(np.maximum(values, 0.0)) * axes).T
    # Doubt of a gain that is none.
    doubt = doubt[np.linalg.norm(doubt, axis=1) > 1e-4]
    told = state_gains(robot, [x.name for x in every], found, believed)
    return replace(robot, servo=replace(found.servo, source=FOUND, found=told, doubt=doubt))


def state_gains(robot: Robot, names: Sequence[str], found: Gains, believed: Bodies) -> str:
    """Return what gains were found, and what fixes their scale."""
    servo, asked = found.servo, robot.servo
    assert asked is not None
    sure = np.sqrt(np.diag(found.covariance))
    free = np.flatnonzero(np.isnan(asked.kp))
    each = [f"{robot.joints[k]} {servo.kp[k]:.4g} (± {percent(sure[k], 2)})" for k in free]
    damped = np.flatnonzero(np.isnan(asked.kv) & (servo.kv > 0))
    said = [f"kp of {listing(each, 12)}"] if each else []
    if len(damped):
        said.append(
            f"kv of {listing([f'{robot.joints[k]} {servo.kv[k]:.4g}' for k in damped], 12)}"
        )
    text = (
        f"Nobody states the gains of the servos, so {listing(list(names), 4)} "
        f"{'tells' if len(names) == 1 else 'tell'} them: {'; '.join(said)}. "
    )
    unit = np.tile(0.5 * np.eye(4)[_UPPER], len(believed.names)).reshape(-1, 10)
    by = found.by_belief[: unit.size].reshape(-1, 10)
    fixed = (by * unit).sum(1) / believed.shares
    if fixed.sum() > 0.5:
        # Share of the scale of a body that is named for it, where bodies fix more than
        # half.
        named = [
            f"{believed.names[k]} ({100 * fixed[k]:.0f} %; within {percent(believed.shares[k])})"
            for k in np.argsort(-fixed)
            if fixed[k] > 0.2
        ]
        body = (
            listing(named, 4)
            if named
            else f"all bodies, each within {100 * PHYSICAL_RULES.body_within:g} %"
        )
        text += (
            "Commands and positions tell ratios alone; what fixes the scale of all numbers is the "
            f"file's {body}: weigh one, and say so ([prior_share])."
        )
    else:
        text += (
            "What fixes their scale is what is stated beside: a gain, a limit, a spring, a "
            "commanded torque."
        )
    if np.isnan(asked.kv).any() and not servo.kv[np.isnan(asked.kv)].any():
        text += " Fv holds kv, too: no commanded speed tells them apart."
    return text
