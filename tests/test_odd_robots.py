"""Odd but legal robots, whose logs MuJoCo alone makes, have an answer, and intervals that hold."""

import json
from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng

from identifiability import IdentifiabilityError, Model, Robot, analyze, find_base_parameters
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.foundation.output import plain
from identifiability.regression.reduction import DEFAULT_EFFECTS

from .marks import everything
from .roads import waves

#: Samples times joints of a log, at most: a larger one asks nothing else.
MOST = 100_000


@dataclass(frozen=True)
class Odd:
    """A robot: scale [m], masses [kg] and joints; its logs: rate [Hz], samples, fastest motion."""

    scale: float
    mass: float
    kinds: str
    rate: float
    samples: int
    fastest: float
    seed: int

    @classmethod
    def draw(cls, seed, joints=30.0, most=MOST):
        """Return a robot; everything is uniform on a scale of logarithms."""
        rng = default_rng(seed)

        def between(low, high):
            return float(np.exp(rng.uniform(np.log(low), np.log(high))))

        scale = between(1e-3, 10.0)
        mass = between(1e-3, 1e3)
        kinds = "".join(rng.choice(list("HHHS"), round(between(1.0, joints))))
        rate = between(10.0, 2e4)
        samples = round(between(30, 1e5))
        own = np.sqrt(9.81 / scale) / (2 * np.pi)  # of a pendulum of this size [Hz]
        fastest = min(rate / 25, own * between(0.5, 5.0))
        return cls(scale, mass, kinds, rate, min(samples, most // len(kinds)), fastest, seed)

    @property
    def bodies(self):
        """Mass, centre, principal moments, axes and joint of every body."""
        rng = default_rng([self.seed, 1])
        made = []
        for kind in self.kinds:
            mass = self.mass * rng.uniform(0.3, 1.0)
            a, b, c = mass * (self.scale * rng.uniform(0.1, 0.3, 3)) ** 2
            quat = rng.normal(size=4)
            load = mass * 9.81 * (self.scale if kind == "H" else 1.0)
            made.append(
                {
                    "mass": np.array(mass),
                    "centre": self.scale * rng.uniform(-0.3, 0.3, 3),
                    "moments": np.array([b + c, a + c, a + b]),
                    "quat": quat / np.linalg.norm(quat),
                    "friction": load * rng.uniform(0.02, 0.2, 2),  # Fc, Fv at a unit of speed
                    "rotor": np.array((a + b if kind == "H" else mass) * rng.uniform(0.1, 1.0)),
                }
            )
        return made

    def text(self, wrong=0.0):
        """Return the MJCF; masses and moments off by a share."""
        rng = default_rng([self.seed, 2])
        opened = []
        for k, (kind, b) in enumerate(zip(self.kinds, self.bodies, strict=True)):
            off = 1 + wrong * rng.uniform(-1, 1)
            row = {n: " ".join(f"{x:.17g}" for x in np.ravel(off * v)) for n, v in b.items()}
            centre, quat = (" ".join(f"{x:.17g}" for x in b[n]) for n in ("centre", "quat"))
            turned = f'quat="{quat}"' if k else ""
            opened.append(
                f'<body name="l{k}" pos="{self.scale if k else 0:.17g} 0 0" {turned}><inertial '
                f'pos="{centre}" mass="{row["mass"]}" diaginertia="{row["moments"]}"/>'
                f'<joint name="j{k}" type="{"hinge" if kind == "H" else "slide"}" axis="0 1 0"/>'
            )
        motors = "".join(f'<motor joint="j{k}"/>' for k in range(len(self.kinds)))
        return (
            '<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/><worldbody>'
            f"{''.join(opened)}{'</body>' * len(self.kinds)}</worldbody>"
            f"<actuator>{motors}</actuator></mujoco>"
        )

    def log(self, which):
        """Return a log: positions with encoder noise, torque with 1 % of its spread as noise."""
        rng = default_rng([self.seed, 3, which])
        n = len(self.kinds)
        t = np.arange(self.samples) / self.rate
        w = 2 * np.pi * self.fastest * rng.uniform(0.1, 1.0, (6, n))
        size = np.where(np.array(list(self.kinds)) == "H", 1.0, self.scale)
        a = size * rng.uniform(0.1, 0.5, (6, n))
        phase = rng.uniform(0, 2 * np.pi, (6, n))
        q, dq, ddq = waves(t, w, a, phase)
        model = mujoco.MjModel.from_xml_string(self.text())
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        data = mujoco.MjData(model)
        tau = np.empty((len(t), n))
        for k in range(len(t)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
            mujoco.mj_inverse(model, data)
            tau[k] = data.qfrc_inverse
        dry, viscous = np.array([b["friction"] for b in self.bodies]).T
        tau += dry * np.sign(dq) + viscous * dq / size
        tau += ddq * np.array([b["rotor"] for b in self.bodies])
        tau += 0.01 * (tau.std(0) + 1e-300) * rng.normal(size=tau.shape)
        q += 1e-5 * size * rng.normal(size=q.shape)
        columns = {
            f"j{k}.{name}": x[:, k] for name, x in (("q", q), ("tau", tau)) for k in range(n)
        }
        return pd.DataFrame({"t": t, **columns})

    def truth(self):
        """Return the parameters that made the logs, by the library's names."""
        model = mujoco.MjModel.from_xml_string(self.text())
        values = dict[str, float]()
        for k, (kind, b) in enumerate(zip(self.kinds, self.bodies, strict=True)):
            m = model.body_mass[k + 1]
            c = model.body_ipos[k + 1]
            turn = np.empty(9)
            mujoco.mju_quat2Mat(turn, model.body_iquat[k + 1])
            R = turn.reshape(3, 3)
            inertia = R @ np.diag(model.body_inertia[k + 1]) @ R.T
            inertia += m * (np.dot(c, c) * np.eye(3) - np.outer(c, c))
            whole = (m, *(m * c), *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]])
            values |= {f"l{k}.{n}": v for n, v in zip(INERTIAL_KINDS, whole, strict=True)}
            size = 1.0 if kind == "H" else self.scale
            own = {"Fc": b["friction"][0], "Fv": b["friction"][1] / size, "Ia": b["rotor"]}
            values |= {f"j{k}.{n}": float(v) for n, v in (own | {"off": 0.0}).items()}
        return values


def outside(odd, path, told):
    """Return how many values are called identifiable, how many are outside, and which."""
    base = find_base_parameters(Robot.load(path), Model.of(*DEFAULT_EFFECTS))
    truth = odd.truth()
    phi = np.array([truth[p.name] for p in base.parameters])
    true = dict(zip(base.names, base.G @ phi, strict=True))
    called = [p for p in told["full_parameters"] if p["verdict"] == "identifiable"]
    bad = [
        f"{p['name']} = {p['value']:.3g}, true {true[p['name']]:.3g}, {p['interval95']}"
        for p in called
        if not p["interval95"][0] <= true[p["name"]] <= p["interval95"][1]
    ]
    return len(called), len(bad), bad


def ask(odd, folder):
    """Return what is said of a robot, as it stands in its JSON; its refusal, if it is refused."""
    path = folder / "robot.xml"
    path.write_text(odd.text(0.1))
    try:
        found = analyze(Robot.load(path), odd.log(0), validate=odd.log(1), replicates=100)
    except IdentifiabilityError as error:
        return path, str(error)
    return path, json.loads(json.dumps(plain(found.to_dict())))


@pytest.mark.parametrize(
    "robots, joints, most",
    [(6, 2.0, 3_000), everything(40, 8.0, 30_000)],
)
def test_odd_robots_have_an_answer_and_intervals_that_hold(robots, joints, most, tmp_path):
    called = wrong = answered = 0
    for seed in range(50_000, 50_000 + robots):
        odd = Odd.draw(seed, joints, most)
        path, told = ask(odd, tmp_path)
        if isinstance(told, str):
            assert told.endswith(".")
            continue
        answered += 1
        assert "nan" not in told["statement"].split()
        counts = outside(odd, path, told)
        called = called + counts[0]
        wrong = wrong + counts[1]
    assert answered > robots / 2
    assert called > robots / 2
    assert wrong <= 0.07 * called + 2 * (0.07 * called) ** 0.5


@pytest.mark.parametrize(
    "scale, mass, kinds, rate, samples",
    [(1e-3, 1e-3, "HS", 2e4, 30), (10.0, 1e3, "H" * 5, 10.0, 30), (10.0, 1e-3, "SS", 2e4, 60)],
)
def test_the_corners_are_answered_or_one_sentence(scale, mass, kinds, rate, samples, tmp_path):
    odd = Odd(scale, mass, kinds, rate, samples, rate / 25, 7)
    told = ask(odd, tmp_path)[1]
    assert isinstance(told, dict) or told.count(". ") <= 2
