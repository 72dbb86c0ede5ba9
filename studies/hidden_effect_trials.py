"""One trial of `hidden_effect.py`: simulate logs with an effect hidden, diagnose, judge.

Motions and their noiseless torque are simulated once for each robot; trials draw their own noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from hidden_effect_outside import EVERY, OUTSIDE

from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.logs.prepare.excerpt import prepare_excerpt
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters
from identifiability.robot import Robot
from identifiability.simulation import Campaign, Noise, random_trajectory, shipped_trajectory
from identifiability.workflows.diagnose import Diagnosis, Problem, diagnose, look
from identifiability.workflows.diagnose.problem import know_nothing
from identifiability.workflows.diagnose.result import NamedEffect

#: Noise of the torque as a share of its rms, its correlation at 100 Hz, and encoders [m or rad].
LEVEL, RHO = 0.012, 0.9
ENCODER = {"3-rps": 1e-6, "five-bar": 2e-5, "six-dof-arm": 2e-5, "two-link": 2e-5}
#: Families, and a size of the order that robots have: rms over that of the joint's torque.
REALISTIC = {
    "stribeck_friction": 0.05,
    "coulomb_asymmetry": 0.03,
    "torque_offset": 0.05,
    "quadratic_friction": 0.05,
    "joint_stiffness": 0.05,
    "load_dependent_friction": 0.05,
    "position_ripple": 0.03,
    "passive_joint_friction": 0.03,
    "time_delay": 0.05,
    "gravity_tilt": 0.02,
}
FAMILIES = tuple(REALISTIC)
#: Share of an effect outside the base model below which this motion cannot name it.
ALIASED = 0.03
#: Effects that are hidden in the whole robot.
WHOLE = ("gravity_tilt",)
#: Effects that the paper neglects, by the family that should be named.
PAPER = ("stribeck_friction", "passive_joint_friction", "actuator_inertia")


@dataclass(frozen=True)
class Job:
    """The hidden effects and the conditions of a trial.

    Attributes
    ----------
    study : {"single", "pair", "outside", "null", "paper"}
    robot : str
    hidden : tuple of str
        Families.
    size : str
        In units of the noise's standard deviation, or ``realistic``.
    rho, motion : float
        Correlation of the torque noise; error of the motion as a share of its rms.
    seed : int
    """

    study: str
    robot: str
    hidden: tuple[str, ...]
    size: str
    rho: float
    motion: float
    seed: int

    @property
    def key(self) -> str:
        """Unique key of the job."""
        return "|".join([self.study, self.robot, "+".join(self.hidden), self.size,
                         f"{self.rho:g}", f"{self.motion:g}", str(self.seed)])  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """Hidden and named effects, and the held-out error before, after and of the truth.

    `visible` is the share of the hidden torque outside the base model, `sd` the rms of that part
    over the noise's; of several hidden effects the least.
    """

    key: str
    study: str
    robot: str
    hidden: str
    size: str
    rho: float
    motion: float
    seed: int
    joints: str
    visible: float
    sd: float
    outcome: str
    named: str
    joints_right: bool
    confirmed: bool
    before: float
    after: float
    truth: float


@cache
def campaign(name: str) -> Campaign:
    """Return five random motions of a robot."""
    robot = Robot.load(name)
    rng = np.random.default_rng(2024)
    return Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(5)])


@cache
def paper_campaign(truth: str) -> tuple[Campaign, np.ndarray]:
    """Return the motions of the paper and two more, and the torque that the simulator adds."""
    robot = Robot.load("3-rps")
    rng = np.random.default_rng(3)
    motions = [shipped_trajectory(robot, k) for k in ("571", "595", "601")]
    motions += [random_trajectory(robot, rng) for _ in range(2)]
    hinges = {f"hinge{k}.{kind}": v for k in (1, 2, 3) for kind, v in (("Fv", 490.8), ("Fc", 34.2))}
    c = Campaign.of(robot, motions, hinges if truth == "passive_joint_friction" else None)
    if truth == "stribeck_friction":
        return c, 372.0 * np.exp(-np.abs(c.move.dq) / 0.08) * np.sign(c.move.dq)
    return c, np.zeros_like(c.torque)


@cache
def base_columns(name: str) -> np.ndarray:
    """Return an orthonormal basis of the base model's columns along the noiseless motion."""
    c = campaign(name)
    parts = []
    for log in c.logs(derivatives=True):
        samples = prepare_log(c.robot, log, Preparation(keep_rest=True))
        parts.append(Model.of(*USUAL_EFFECTS).regressor(c.robot, samples.motion))
    W = np.concatenate(parts)[:, :, find_base_parameters(c.robot, Model.of(*USUAL_EFFECTS)).kept]
    flat = W.reshape(-1, W.shape[2])
    return np.linalg.qr(flat / np.linalg.norm(flat, axis=0))[0]


def place(name: str, family: str, seed: int) -> str:
    """Return where an effect is hidden: another joint for every seed; "none" without a place."""
    robot = campaign(name).robot
    if family in WHOLE:
        return ""
    if family == "passive_joint_friction":
        joints = [a.name for a in robot.passive_axes if "ball" not in a.name]
    else:
        joints = list(robot.joints)
    return joints[seed % len(joints)] if joints else "none"


@cache
def unit_torque(name: str, family: str, joint: str) -> tuple[np.ndarray, float, float, float]:
    """Return a hidden torque (N, n), its rms, the part of it that is visible, the joint's torque.

    All rms are those of the joint where it is largest; visible is the share outside the base model.
    """
    c = campaign(name)
    unit = c.hidden([f"{family}{'@' if joint else ''}{joint}=1"])
    flat = unit.reshape(-1)
    Q = base_columns(name)
    left = (flat - Q @ (Q.T @ flat)).reshape(unit.shape)
    k = int(np.argmax(np.abs(unit).sum(0)))
    rms = float(np.sqrt(np.mean(unit[:, k] ** 2)))
    visible = float(np.sqrt(np.mean(left[:, k] ** 2))) / rms
    return unit, rms, visible, float(np.sqrt(np.mean(c.torque[:, k] ** 2)))


def hidden_torque(name: str, family: str, joint: str, size: str) -> np.ndarray:
    """Return the torque that is hidden: of a realistic size, or its visible part × the noise."""
    unit, rms, visible, torque = unit_torque(name, family, joint)
    if size == "realistic":
        return unit * (REALISTIC[family] * torque / rms)
    return unit * (float(size) * LEVEL * torque / max(visible * rms, 1e-12))


def simulated(
    name: str, torque: np.ndarray, seed: int, rho: float = RHO, motion: float = 0.0
) -> list[Log]:
    """Return five noisy logs; errors in the motion come with measured derivatives."""
    noise = Noise(
        motion=motion, additive=LEVEL, correlation=rho, encoder=0 if motion else ENCODER[name]
    )
    rng = np.random.default_rng([seed, 77])
    return campaign(name).logs(torque, noise, rng, derivatives=bool(motion))


def judge(d: Diagnosis, truth: set[str], joints: set[str]) -> tuple[str, bool]:
    """Return the outcome in one word, and whether the joints are the true ones."""
    named = {e.name for e in d.effects}
    alternatives = {a for e in d.effects for a in e.alternatives}
    found = {j for e in d.effects for j in e.joints} - {"base"}
    if named == truth:
        return "A or B" if alternatives else "exact", found == joints
    if not named:
        return "none", False
    if len(named) == len(truth) and truth <= named | alternatives:
        return "A or B", found == joints
    return ("truth and more" if truth < named else "wrong"), False


@cache
def true_error(name: str, seed: int) -> float:
    """Return the held-out error of the true model: of the same noise with nothing hidden."""
    robot = campaign(name).robot
    logs = simulated(name, np.zeros_like(campaign(name).torque), seed)
    samples = tuple(prepare_excerpt(robot, log, None) for log in logs)
    structure = Structure.of(robot, Model.of(*USUAL_EFFECTS))
    found = look(Problem(structure, samples[:4], know_nothing(structure), samples[4:]), ())
    return float(found.predict_unseen([found.fit(())]).relative_error()[0])


def run(job: Job) -> Trial | None:
    """Run a trial; None where the robot has no place for the effect."""
    if job.study == "paper":
        return _run_paper(job)
    name, seed = job.robot, job.seed
    places = [place(name, f, seed + k) for k, f in enumerate(job.hidden)]
    if "none" in places:
        return None
    torque = np.zeros_like(campaign(name).torque)
    visible, sd = 1.0, np.inf if job.hidden else 0.0
    for family, joint in zip(job.hidden, places, strict=True):
        _, _, seen, _ = unit_torque(name, family, joint)
        visible = min(visible, seen)
        sd = min(sd, _size(job.size, family, seen))
        if visible < ALIASED:
            return _trial(job, places, (visible, sd), "aliased", None, right=True, truth=np.nan)
        torque = torque + hidden_torque(name, family, joint, job.size)
    logs = simulated(name, torque, seed, job.rho, job.motion)
    known = None
    if job.study == "outside":
        held_back = {job.hidden[0], *OUTSIDE[job.hidden[0]]}
        known = [f for f in EVERY if f not in held_back]
    d = diagnose(campaign(name).robot, logs[:4], logs[4:], effects=known, seed=seed, forward=False)
    outcome, right = judge(d, set(job.hidden), set(places) - {""})
    if job.study == "null":
        outcome, right = ("false name" if d.effects else "no name"), True
    elif job.study == "outside":
        outcome, right = _judge_outside(d, set(places))
    truth = true_error(name, seed) if job.study in ("single", "pair") else np.nan
    return _trial(job, places, (visible, sd), outcome, d, right=right, truth=truth)


def _judge_outside(d: Diagnosis, joints: set[str]) -> tuple[str, bool]:
    """Return the outcome for an effect outside the dictionary, and whether its joint was found."""
    if any(not e.unnamed for e in d.effects):
        return "false name", False
    return ("function" if d.effects else "no name"), {
        j for e in d.effects for j in e.joints
    } == joints


def _size(size: str, family: str, visible: float) -> float:
    """Return the ratio of the rms of the visible hidden torque to that of the noise."""
    return REALISTIC[family] * visible / LEVEL if size == "realistic" else float(size)


def _run_paper(job: Job) -> Trial:
    (truth,) = job.hidden
    source, added = paper_campaign(truth)
    noise = Noise(additive=LEVEL, correlation=RHO, encoder=ENCODER["3-rps"])
    logs = source.logs(added, noise, np.random.default_rng([job.seed, 5]))
    model = USUAL_EFFECTS[:3] if truth == "actuator_inertia" else USUAL_EFFECTS
    d = diagnose(source.robot, logs[:4], logs[4:], model=model, seed=job.seed)
    where = ("hinge1", "hinge2", "hinge3")
    joints = set(where if truth == "passive_joint_friction" else source.robot.joints)
    outcome, right = judge(d, {truth}, joints)
    return _trial(job, sorted(joints), (np.nan, np.nan), outcome, d, right=right, truth=np.nan)


def _state(effect: NamedEffect) -> str:
    """Return its names, the likeliest first, and its joints."""
    names = " or ".join((effect.name, *effect.alternatives))
    return f"{names} in {'+'.join(effect.joints)}"


def _trial(
    job: Job, places: list[str], seen: tuple[float, float], outcome: str, d: Diagnosis | None, *,
    right: bool, truth: float,
) -> Trial:  # fmt: skip
    effects = () if d is None else d.effects
    return Trial(
        job.key, job.study, job.robot, "+".join(job.hidden), job.size, job.rho, job.motion,
        job.seed, "+".join(places), *seen, outcome,
        "; ".join(map(_state, effects)), bool(right),
        all(e.confirmed for e in effects),
        np.nan if d is None else d.held_before, np.nan if d is None else d.held_after, truth,
    )  # fmt: skip
