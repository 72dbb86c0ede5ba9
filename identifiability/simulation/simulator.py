"""The simulated robot with known truth: `simulate` makes a log, `Campaign` many."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, near_match
from identifiability.foundation.linalg import filter_from_rest
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.options import Expected, Names, Rng, Seed, check_fields, checked
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.robot import Robot, RobotLike

from .elastic import bend
from .forces import PAUSE, Law, both_directions, hidden_torque, joint_torque, parse_hidden
from .motion import PrescribedMotion, Trajectory
from .mujoco_robot import MujocoRobot, RigidTorque

# Noise on simulated logs.


Level = Annotated[float, Expected("a number of at least 0", lambda x: 0 <= x < np.inf)]
Correlation = Annotated[float, Expected("a number of at least 0 and below 1", lambda x: 0 <= x < 1)]


@frozen
class Noise:
    """Measurement noise.

    Attributes
    ----------
    motion : float
        Standard deviation of q, dq and ddq, independently, as a share of each sample's value.
    torque : float
        The same of the torque [Díaz 2010, Eq. 17; 0.04 and 0.05 are the paper's].
    additive : float
        Standard deviation of additive torque noise as a share of each joint's torque rms.
    correlation : float
        AR(1) coefficient of the additive noise from sample to sample.
    encoder : float [rad or m]
        Resolution of the positions; 0 for none.
    motion_additive : float
        Standard deviation of additive noise on q, dq and ddq, from sample to sample, as a share of
        that of each channel and joint. Near reversals it changes the sign of velocity, unlike
        `motion`.
    """

    motion: Level = 0.0
    torque: Level = 0.0
    additive: Level = 0.0
    correlation: Correlation = 0.0
    encoder: Level = 0.0
    motion_additive: Level = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "noise level")

    @staticmethod
    def parse(text: str) -> Noise:
        """Return the noise of ``paper``, ``none`` or ``motion=0.04,torque=0.05``.

        Raises
        ------
        IdentifiabilityError
        """
        named = {"paper": PAPER_NOISE, "none": Noise()}
        if text in named:
            return named[text]
        known = list(Noise.__dataclass_fields__)
        settings = text.replace(" ", "").split(",")
        given = dict(part.partition("=")[::2] for part in settings)
        try:
            values = {name: float(number) for name, number in given.items()}
        except ValueError:
            values = {text: 0.0}
        for name in values:
            if name not in known:
                raise IdentifiabilityError(
                    f"There is no noise or level '{name}'{near_match(name, [*named, *known])} Give "
                    f"'paper', 'none', or levels such as 'motion=0.04,torque=0.05' of "
                    f"{', '.join(known)}."
                )
        return Noise(**values)

    def on_motion(self, values: Array, rng: np.random.Generator) -> Array:
        """Return positions, velocities or accelerations (N, n) with relative and additive noise."""
        out = values * (1 + self.motion * rng.standard_normal(values.shape))
        if self.motion_additive:
            size = self.motion_additive * values.std(0)
            out = out + size * rng.standard_normal(values.shape)
        return out

    def on_torque(self, tau: Array, rng: np.random.Generator, level: Array | None = None) -> Array:
        """Return torques (N, n) with relative and with additive, autocorrelated noise.

        Additive noise is a share of `level` (n,), by default of the rms of the torque.
        """
        out = tau * (1 + self.torque * rng.standard_normal(tau.shape))
        if self.additive:
            size = np.sqrt(np.mean(tau**2, 0)) if level is None else level
            out = out + self.additive * size * ar1(tau.shape, self.correlation, rng)
        return out

    def on_encoder(self, q: Array) -> Array:
        """Return positions rounded to the encoder's resolution."""
        if self.encoder:
            return np.round(q / self.encoder) * self.encoder
        return q


#: The paper's noise: δ = 4 % on the motion, η = 5 % on the forces, per sample.
PAPER_NOISE = Noise(motion=0.04, torque=0.05)


def ar1(shape: tuple[int, ...], correlation: float, rng: np.random.Generator) -> Array:
    """Return stationary AR(1) noise of unit variance along the first axis."""
    white = rng.standard_normal(shape)
    white[1:] *= np.sqrt(1 - correlation**2)
    return filter_from_rest(np.array([1.0, -correlation]), white)


MOTION = "a PrescribedMotion or a Trajectory, such as shipped_trajectory gives"
NOISE = "a Noise, 'paper', 'none' or levels such as 'motion=0.04,torque=0.05'"

NoiseLike = Annotated[Noise | str, Expected(NOISE)]


@checked
def simulate(
    robot: RobotLike,
    motion: Annotated[PrescribedMotion | Trajectory, Expected(MOTION)],
    *,
    noise: NoiseLike | None = None,
    hide: Names = (),
    laws: Mapping[str, Callable[..., Any]] | None = None,
    parameters: NumberByName | None = None,
    rng: Rng | None = None,
    derivatives: bool = True,
    seed: Seed = 0,
) -> Log:
    """Return the log of a simulated robot along a prescribed motion.

    Parameters
    ----------
    robot : Robot, path or shipped name
        Its file states the inertias; friction, rotor inertia and springs come from its nominal
        values. Other nominal effects (`left_out`) are not simulated. Links behind springs bend:
        the motion is that of the motors, and `Campaign.deflection` has that of the links.
    motion : PrescribedMotion or Trajectory
    noise : Noise or str, optional
        Levels such as ``motion=0.04,torque=0.05``, ``paper`` or, by default, ``none``.
    hide : sequence of str
        Effects that are in the data and not in the robot file: ``effect``, ``effect=share`` of the
        torque or ``effect@joint+joint=share``. The share and the effect's shape are those of this
        motion: logs of one effect along several motions come from `Campaign`.
    laws : mapping of name to callable(speed, position from home, load) -> force, optional
        Further effects that can be hidden in a joint, arrays (N,), each up to a factor;
        `identifiability.effects.effect_laws` gives those that were registered.
    parameters : mapping, optional
        Joint parameters that differ from the nominal ones (``slider1.Fv`` …).
    rng : numpy.random.Generator, optional
        Draws the noise; by default one of `seed`.
    derivatives : bool
        Whether the log has velocities and accelerations.
    seed : int
        Seed of every random choice, as in every verb; unused where `rng` is given.

    Raises
    ------
    IdentifiabilityError
        If an effect cannot be hidden in this robot, or the motion leaves the workspace.
    """
    rng = rng or np.random.default_rng(seed)
    noise = Noise.parse(noise) if isinstance(noise, str) else noise or Noise()
    robot = Robot.of(robot)
    robot.check_stands("simulation")
    campaign = Campaign.of(robot, [motion], parameters)
    tau = noise.on_torque(campaign.torque + campaign.hidden(hide, laws), rng)
    return _record(robot, campaign.moves[0], tau, noise, rng, derivatives=derivatives)


def _record(
    robot: Robot,
    move: PrescribedMotion,
    tau: Array,
    noise: Noise,
    rng: np.random.Generator,
    *,
    derivatives: bool,
) -> Log:
    """Return the log of a motion, to which noise is added, and of a torque (N, n)."""
    q = noise.on_encoder(noise.on_motion(move.q, rng))
    dq = noise.on_motion(move.dq, rng)
    ddq = noise.on_motion(move.ddq, rng)
    log = Log(
        name=move.name,
        joints=robot.joints,
        t=move.t,
        q=q,
        tau=tau,
        dq=dq if derivatives else None,
        ddq=ddq if derivatives else None,
        sha256="",
    )
    return Log.from_frame(log.to_frame(), move.name, Conventions(time_unit="s"))


@frozen(kw_only=True)
class Campaign:
    """Motions of one simulated robot, of which many noisy logs can be made.

    A hidden effect has one size in all of them.

    Attributes
    ----------
    robot : Robot
    moves : tuple of PrescribedMotion
    move : PrescribedMotion
        All motions one after the other.
    rigid : RigidTorque
    torque : (N, n)
        Without hidden effects and noise.
    log : (N,) int
        Which motion a sample belongs to.
    deflection : (N, n) [rad or m]
        Of links behind springs of the robot file: a link is at the motor's position plus this.
    """

    robot: Robot
    moves: tuple[PrescribedMotion, ...]
    move: PrescribedMotion
    rigid: RigidTorque
    torque: Array
    log: np.ndarray
    deflection: Array

    @staticmethod
    def of(
        robot: Robot,
        motions: Sequence[PrescribedMotion | Trajectory],
        parameters: NumberByName | None = None,
    ) -> Campaign:
        """Compute the torque along some motions once."""
        moves = [m if isinstance(m, PrescribedMotion) else PrescribedMotion.of(m) for m in motions]
        start = 0.0
        times = []
        for m in moves:
            times.append(m.t - m.t[0] + start)
            start = times[-1][-1] + PAUSE
        q, dq, ddq = (np.concatenate([getattr(m, k) for m in moves]) for k in ("q", "dq", "ddq"))
        whole = PrescribedMotion(np.concatenate(times), q, dq, ddq)
        rigid = MujocoRobot(robot).inverse_dynamics(whole.q, whole.dq, whole.ddq)
        bent = np.zeros_like(whole.q)
        if robot.springs:
            found = [bend(robot, m) for m in moves]
            torque, bent = (np.concatenate(x) for x in zip(*found, strict=True))
            rigid = replace(rigid, tau=torque)
        values = {**robot.nominal, **both_directions(parameters or {})}
        return Campaign(
            robot=robot,
            moves=tuple(moves),
            move=whole,
            rigid=rigid,
            torque=rigid.tau + joint_torque(robot, whole, rigid, values),
            log=np.repeat(np.arange(len(moves)), [len(m.t) for m in moves]),
            deflection=bent,
        )

    def hidden(self, hide: Sequence[str], laws: Mapping[str, Law] | None = None) -> Array:
        """Return the torque of hidden effects as in `simulate`, (N, n)."""
        out = np.zeros_like(self.torque)
        for text in hide:
            found = parse_hidden(text, laws)
            out += hidden_torque(self.robot, self.move, self.rigid, self.torque, found)
        return out

    def logs(
        self,
        hide: Sequence[str] | Array = (),
        noise: Noise | None = None,
        rng: np.random.Generator | None = None,
        *,
        derivatives: bool = False,
    ) -> list[Log]:
        """Return one noisy log for each motion. Its times start at zero; starts are on one clock.

        Parameters
        ----------
        hide : sequence of str, or (N, n)
            Hidden effects as in `simulate`, or their torque.
        noise : Noise, optional
        rng : numpy.random.Generator
        derivatives : bool
            Whether logs have velocities and accelerations.
        """
        rng = rng or np.random.default_rng(0)
        noise = noise or Noise()
        clean = self.torque + (hide if isinstance(hide, np.ndarray) else self.hidden(hide))
        level = np.sqrt(np.mean(self.torque**2, axis=0))
        out = []
        for k, move in enumerate(self.moves):
            tau = noise.on_torque(clean[self.log == k], rng, level)
            named = replace(move, t=move.t - move.t[0], name=f"motion {k + 1}")
            log = _record(self.robot, named, tau, noise, rng, derivatives=derivatives)
            first = np.argmax(self.log == k)
            start = float(self.move.t[first])
            out.append(replace(log, start=start))
        return out
