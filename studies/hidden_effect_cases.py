"""One drawn case of `hidden_effect_drawn.py`: what is hidden where, its logs, and the verdict."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from identifiability.effects import FAMILIES
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters
from identifiability.robot import Robot
from identifiability.simulation import Campaign, Noise, random_trajectory
from identifiability.simulation.forces import hideable
from identifiability.workflows.diagnose import Diagnosis, Problem, Setting, diagnose
from identifiability.workflows.diagnose.evidence import Products, View, explain, factor_of
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.rows import Table
from identifiability.workflows.diagnose.workflow import usual_effects

ROBOTS = (
    "two-link", "six-dof-arm", "five-bar", "3-rps", "delta", "3-rrr", "palletizer",
    "six-actuators", "dvrk-mtm", "dvrk-psm", "scara", "differential-wrist",
)  # fmt: skip
#: Noise of the torque as a share of its rms, 0.9 correlated at 100 Hz; and encoders [rad, m].
LEVEL, ENCODER = 0.012, (2e-5, 1e-6)
NOISE = Noise(additive=LEVEL, correlation=0.9)
#: Motions of a case: four to fit, one to verify.
MOTIONS, FITTED = 5, 4
#: Share of an effect outside the base model below which its motion cannot name it.
ALIASED = 0.03
#: Similarity from which on two names are one to this motion.
SIMILAR = 0.9
#: Hidden in the whole robot; needs values that are kept; has no name.
WHOLE, KEPT, NAMELESS = "gravity_tilt", "payload", "thermal_drift"
#: What can be hidden and named, and what of it depends on at most two of position, velocity, load,
#: time and another joint's velocity, without memory.
NAMED = tuple(f for f in hideable() if f not in (KEPT, NAMELESS))
SMOOTH = (
    "stribeck_friction", "rising_friction", "sigmoid_friction", "quadratic_friction",
    "velocity_leak", "torque_scale", "load_dependent_friction", "position_friction",
    "joint_stiffness", "free_spring", "gravity_spring", "position_torque", "torque_drift",
    "friction_drift", "thermal_drift",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """What a draw decided.

    Attributes
    ----------
    number : int
    robot, family, place : str
        The place is empty for what is hidden in the whole robot.
    motions, noise : int
        Seeds; all cases of a robot have the same motions.
    """

    number: int
    robot: str
    family: str
    place: str
    motions: int
    noise: int


def draw_case(seed: int, number: int, families: tuple[str, ...]) -> Case:
    """Return a case of a draw: each family that has a place in its robot is equally likely.

    What its motions cannot show, because the base model says it as well, is drawn again.
    """
    name = robot_of(seed, number)
    robot = Robot.load(name)
    motions = int(np.random.default_rng([seed, ROBOTS.index(name), 1]).integers(1 << 31))
    rng = np.random.default_rng([seed, number, 2])
    places = {f: list_places(robot, f) for f in families}
    while True:
        family = str(rng.choice([f for f in families if places[f]]))
        place = str(rng.choice(places[family]))
        case = Case(number, name, family, place, motions, int(rng.integers(1 << 31)))
        if hidden_torque(case, 1.0)[1] >= ALIASED:
            return case


def robot_of(seed: int, number: int) -> str:
    """Return the robot of a case: each is equally likely."""
    return str(np.random.default_rng([seed, number]).choice(ROBOTS))


def list_places(robot: Robot, family: str) -> list[str]:
    """Return where an effect can be hidden in a robot; an empty name is the whole of it."""
    if family == WHOLE:
        return [""] if not FAMILIES[family].refuse(robot, "base") else []
    if family == NAMELESS:
        return list(robot.joints)
    known = FAMILIES[family]
    if family == "passive_joint_friction":
        can = {a.name for a in robot.passive_axes}
    else:
        can = set(robot.joints)
    return [p for p in known.places(robot) if p in can and not known.refuse(robot, p)]


@lru_cache(maxsize=len(ROBOTS))
def campaign(name: str, motions: int) -> Campaign:
    """Return random motions of a robot, with its torque along them."""
    robot, rng = Robot.load(name), np.random.default_rng(motions)
    return Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(MOTIONS)])


@lru_cache(maxsize=len(ROBOTS))
def base_columns(name: str, motions: int) -> Array:
    """Return an orthonormal basis of the base model's columns along noiseless motion."""
    c = campaign(name, motions)
    model, parts = Model.of(*usual_effects(c.robot)), []
    for log in c.logs(derivatives=True):
        samples = prepare_samples(c.robot, log, Preparation(keep_rest=True))
        parts.append(model.regressor(c.robot, samples.motion))
    W = np.concatenate(parts)[:, :, find_base_parameters(c.robot, model).kept]
    flat = W.reshape(-1, W.shape[2])
    length = np.linalg.norm(flat, axis=0)
    Q: Array = np.linalg.qr(flat / np.where(length > 0, length, 1.0))[0]
    return Q


def hidden_torque(case: Case, size: float) -> tuple[Array, float]:
    """Return the torque that is hidden (N, n) and the share of it that the base model lacks.

    At the joint where it is largest the part outside the base model is `size` times the noise.
    """
    c = campaign(case.robot, case.motions)
    unit = c.hidden([f"{case.family}{'@' if case.place else ''}{case.place}=1"])
    flat, Q = unit.reshape(-1), base_columns(case.robot, case.motions)
    left = (flat - Q @ (Q.T @ flat)).reshape(unit.shape)
    k = int(np.argmax((unit**2).sum(0)))
    whole, outside, torque = (np.sqrt(np.mean(x[:, k] ** 2)) for x in (unit, left, c.torque))
    if not whole > 0:
        return unit, 0.0
    return unit * (size * LEVEL * torque / max(outside, 1e-12)), float(outside / whole)


def make_logs(case: Case, hidden: Array, noise: Noise = NOISE) -> list[Log]:
    """Return the noisy logs of a case; positions are those of encoders, without derivatives.

    They say when they began on the clock of their session, as logs with stamps do.
    """
    c = campaign(case.robot, case.motions)
    rng = np.random.default_rng(case.noise)
    logs = c.logs(hidden, noise, rng)
    step = np.array([ENCODER[c.robot.is_prismatic(int(k))] for k in c.robot.actuated])
    return [replace(log, q=np.round(log.q / step) * step) for log in logs]


@lru_cache(maxsize=4)
def find_similar(case: Case) -> dict[str, float]:
    """Return how much of the hidden torque each other family could be, beside the base model.

    It is the cosine between them, in units of the noise: for families of one column what a
    diagnosis calls similarity.
    """
    robot, hidden = campaign(case.robot, case.motions).robot, hidden_torque(case, 1.0)[0]

    def prepared(noise: Noise, torque: Array) -> tuple[Samples, ...]:
        logs = make_logs(case, torque, noise)[:FITTED]
        return tuple(prepare_rows(robot, log, None) for log in logs)

    structure = Structure.of(robot, Model.of(*usual_effects(robot)))
    known = [f.name for f in FAMILIES.values() if not f.unnamed]
    setting = Setting(structure, prepared(NOISE, hidden))
    with_it, without = (
        Table.of(structure, prepared(Noise(), torque)).bare.tau for torque in (hidden, 0 * hidden)
    )
    out: dict[str, float] = {}
    for (family, _), own in resemble(Problem(setting, known), with_it - without)[0].items():
        out[family] = max(out.get(family, 0.0), own)
    return out


def resemble(p: Problem, torque: Array) -> tuple[dict[tuple[str, str], float], float]:
    """Return how much of a torque (N, n) each family and place could be, beside the base model.

    Returns
    -------
    similar : mapping of (family, place) to float
        The cosine between them, in units of the noise.
    size : float
        Of the torque beside the base model, in standard errors.
    """
    joints = p.rows.joints
    products = Products(replace(p.rows, tau=torque), p.noise)
    view = View(products, np.zeros(joints, int), np.ones(joints), p.sizes)
    evidence, G = view.evidence, view.total(())
    whole = float(G[0, 0] - np.sum((factor_of(G[1:, 1:]) @ G[1:, 0]) ** 2))
    out: dict[tuple[str, str], float] = {}
    for c in p.candidates:
        at = list(c.columns)
        z = evidence.z[at]
        if c.positive and len(at) == 1 and z[0] < 0:
            continue
        P = evidence.among(np.array([at]))[0]
        square, _ = explain(P, z, evidence.own[at], ALIASED)
        cosine = float(np.sqrt(min(square / max(whole, 1e-300), 1.0)))
        out[c.group] = max(out.get(c.group, 0.0), cosine)
    return out, float(np.sqrt(max(whole, 0.0)))


def run_case(case: Case, size: float, *, outside: bool = False) -> dict[str, Any]:
    """Hide, diagnose and judge; `outside` holds back the name and all that is one with it."""
    start = time.process_time()
    torque, visible = hidden_torque(case, size)
    logs = make_logs(case, torque)
    every = find_similar(case)
    similar = {f: s for f, s in every.items() if f != case.family}
    known = None
    if outside:
        held_back = {case.family, *(f for f, s in similar.items() if s >= SIMILAR)}
        known = [f for f in FAMILIES if f not in held_back]
    robot = campaign(case.robot, case.motions).robot
    d = diagnose(robot, logs[:FITTED], logs[FITTED:], effects=known, seed=case.noise, forward=False)
    rival, similarity = max(similar.items(), key=lambda x: x[1], default=("", 0.0))
    return {
        **vars(case),
        "size": size,
        "outside": outside,
        "outcome": judge_outside(d) if outside else judge(d, case),
        "named": "; ".join(f"{e.names} in {'+'.join(e.joints)}" for e in d.effects),
        "refuted": "; ".join(f"{e.names} in {'+'.join(e.joints)}" for e in d.refuted),
        "confirmed": all(e.confirmed for e in d.effects),
        "visible": visible,
        "rival": rival,
        "similarity": similarity,
        "own_similarity": every.get(case.family, 0.0),
        "held_back": [] if known is None else sorted(held_back),
        "before": d.held_before,
        "after": d.held_after,
        "seconds": time.process_time() - start,
    }


def judge(d: Diagnosis, case: Case) -> str:
    """Return the outcome: the name counts with its joint, and "A or B" has the truth in it."""
    place = case.place or "base"
    truth = (case.family, place)
    named = {(e.name, j) for e in d.effects for j in e.joints}
    if not named:
        return "none"
    if named == {truth}:
        return "A or B" if d.effects[0].alternatives else "exact"
    if truth in named:
        return "truth and more"
    rivals = [r for e in d.effects for p in e.placements for r in p.rivals]
    among = any((r.family, r.place) == truth and r.undecided for r in rivals)
    if among:
        return "A or B" if len(named) == 1 else "truth and more"
    return "function" if all(e.unnamed for e in d.effects) else "wrong"


def judge_outside(d: Diagnosis) -> str:
    """Return what became of an effect that has no name: shown functions were confirmed."""
    if any(not e.unnamed for e in d.effects):
        return "wrong name"
    return "function" if d.effects else "none"
