"""Robots that nothing holds: a body in a hand, an arm on a cart, a quadruped that trots and swings.

The quadruped stands on its feet in MuJoCo, contacts by its solver, servos by a loop of our own. Its
logs are low-passed before they are sampled; the IMU has noise, encoders have 14 bits, torque has
noise of 2 %.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import mujoco
import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from identifiability.foundation.names import Array
from identifiability.logs.signals import lowpass
from identifiability.robot.locate import shipped_folder

XYZ = "xyz"
LEGS = ("FL", "FR", "RL", "RR")

#: Of the sine sums that bases and joints move by [Hz], and how many terms they have.
SLOW, FAST, TERMS = 0.2, 1.2, 5


def sine_sum(t: Array, size: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return motions (N, n) of some sizes (n,), their velocities and accelerations."""
    n = len(size)
    w = 2 * np.pi * rng.uniform(SLOW, FAST, (n, TERMS))
    A = rng.uniform(-1, 1, (n, TERMS)) * np.asarray(size)[:, None]
    at = w * t[:, None, None] + rng.uniform(0, 2 * np.pi, (n, TERMS))
    q, v, a = A * np.sin(at), A * w * np.cos(at), -A * w**2 * np.sin(at)
    return q.sum(2), v.sum(2), a.sum(2)


def columns(stem: str, x: Array, letters: str = XYZ) -> dict[str, Array]:
    """Return columns of a table."""
    return {f"{stem}{a}": x[:, k] for k, a in enumerate(letters)}


def moved_body(seed: int, seconds: float = 8.0) -> pd.DataFrame:
    """Return the log of a body that a hand moves."""
    m = mujoco.MjModel.from_xml_path(str(shipped_folder() / "free-body/robot.xml"))
    m.opt.timestep, every = 0.001, 10
    d, rng, rows = mujoco.MjData(m), np.random.default_rng(seed), []
    f, phase = rng.uniform(0.3, 1.5, (2, 6, 3))
    for _ in range(round(seconds / m.opt.timestep)):
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        here, turn = (x.reshape(3, 3) for x in (d.site_xmat[0], d.xmat[1]))
        wrench = np.sin(2 * np.pi * (f * d.time + phase)).sum(1) * [5, 5, 5, 1, 1, 1]
        wrench[:3] += here.T @ (-8 * d.qvel[:3] - 40 * (d.qpos[:3] - [0, 0, 1]) + [0, 0, 24.5])
        upright = Rotation.from_matrix(turn).as_rotvec()
        wrench[3:] += here.T @ (turn @ (-0.5 * d.qvel[3:]) - 6 * upright)
        d.qfrc_applied[:] = 0
        force, moment = here @ wrench[:3], here @ wrench[3:]
        mujoco.mj_applyFT(m, d, force, moment, d.site_xpos[0], 1, d.qfrc_applied)
        mujoco.mj_forward(m, d)
        acc = turn.T @ (d.qacc[:3] - m.opt.gravity)
        rows.append(np.concatenate([[d.time], acc, d.qvel[3:], wrench]))
        d.qvel += m.opt.timestep * d.qacc
        mujoco.mj_integratePos(m, d.qpos, d.qvel, m.opt.timestep)
        d.time += m.opt.timestep
    x = np.array(rows)
    x[:, 1:] = lowpass(x[:, 1:], m.opt.timestep, 20.0)
    x = x[::every]
    x[:, 1:] += rng.standard_normal(x[:, 1:].shape) * np.repeat([0.02, 0.002, 0.05, 0.01], 3)
    names = ["t", *(f"base.{k}.{a}" for k in ("acc", "gyro") for a in XYZ)]
    return pd.DataFrame(x, columns=[*names, "fx", "fy", "fz", "mx", "my", "mz"])


def cart_arm(seed: int, *, pushed: bool, load: float = 0.0, rubs: float = 0.0) -> pd.DataFrame:
    """Return the log of the arm on its cart, at rest or pushed by a hand.

    A load [kg] may hang at the end of its lower arm, and its shoulder rub more [N·m].
    """
    seconds, rate = 10.0, 100.0
    text = (shipped_folder() / "cart-arm/robot.xml").read_text(encoding="utf-8")
    if load:
        ball = f'<inertial pos="0 0 -0.25" mass="{load}" diaginertia="1e-6 1e-6 1e-6"/>'
        text = text.replace("</body>", f"<body>{ball}</body></body>", 1)
    m = mujoco.MjModel.from_xml_string(text)
    friction, m.dof_frictionloss[:] = m.dof_frictionloss[6:].copy(), 0.0
    friction[1] += rubs
    d, rng, t = mujoco.MjData(m), np.random.default_rng(seed), np.arange(0, seconds, 1 / rate)
    q, v, a = sine_sum(t, np.full(3, 0.4), rng)
    shift, _, push = (x * pushed for x in sine_sum(t, np.full(3, 0.15), rng))
    angle, spin, faster = (x * pushed for x in sine_sum(t, np.full(1, 0.12), rng))
    axis = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    turn = Rotation.from_rotvec(angle * axis)
    tau = np.empty_like(q)
    for k in range(len(t)):
        d.qpos[:] = np.concatenate([shift[k], turn[k].as_quat()[[3, 0, 1, 2]], q[k]])
        d.qvel[3:], d.qacc[:] = (
            np.append(spin[k] * axis, v[k]),
            np.concatenate([push[k], faster[k] * axis, a[k]]),
        )
        mujoco.mj_inverse(m, d)
        tau[k] = d.qfrc_inverse[6:] + friction * np.sign(v[k])
    acc = turn.inv().apply(push - m.opt.gravity) + 0.05 * rng.standard_normal((len(t), 3))
    gyro = spin * axis + 0.005 * rng.standard_normal((len(t), 3))
    table = {"t": t}
    for k, name in enumerate(("yaw", "shoulder", "elbow")):
        table[f"{name}.q"] = q[:, k] + 1e-5 * rng.standard_normal(len(t))
        table[f"{name}.tau"] = tau[:, k] + 0.02 * tau[:, k].std() * rng.standard_normal(len(t))
    if pushed:
        table |= columns("base.acc.", acc) | columns("base.gyro.", gyro)
    return pd.DataFrame(table)


def write_logs() -> None:
    """Write the logs that come with the models."""
    made = {
        "free-body/logs/run1.csv": moved_body(0),
        "cart-arm/logs/pushed.csv": cart_arm(0, pushed=True),
        "cart-arm/logs/bolted.csv": cart_arm(0, pushed=False),
    }
    made |= {
        f"walking-quadruped/logs/{kind}.csv": walking_log(0, kind, 125.0, wrenches=False)
        for kind in KINDS
    }
    for name, frame in made.items():
        frame.to_csv(shipped_folder() / name, index=False, float_format="%.5g")
        print(name, len(frame))


# The quadruped: planned feet, legs that follow them, the solver's contacts.


STEP, RATE, FOOT, GAINS = 5e-4, 250.0, 0.02, (120.0, 2.5)
KINDS = {"trot": 6.0, "swing": 12.0}
SIDES = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])


def smooth(x: Array) -> Array:
    """Return a step from zero to one."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def plan_legs(t: Array, kind: str, rng: np.random.Generator) -> Array:
    """Return angles of the legs (N, 12): the trunk sways, feet trot in pairs or swing in turn."""
    begun = np.minimum(t, 1.0)[:, None]
    sway = begun * sine_sum(t, np.array([0.016, 0.013, 0.013]), rng)[0]
    tilt = begun * sine_sum(t, np.full(3, 0.036), rng)[0]
    wiggle = 2 * sine_sum(2.5 * t, np.full(12, 0.45), rng)[0].reshape(-1, 4, 3)
    lift, shift = np.zeros((len(t), 4)), np.zeros((len(t), 3))
    if kind == "trot":
        for k, (x, y) in enumerate(SIDES):
            phase = ((t - 1) / 0.5 + 0.5 * (x * y < 0)) % 1
            lift[:, k] = np.where((t > 1) & (phase < 0.4), np.sin(np.pi * phase / 0.4) ** 2, 0)
        size, height = np.array([0.03, 0.03, 0.015]), 0.06
    else:
        slot, phase = ((t - 1) // 2.5).astype(int) % 4, ((t - 1) % 2.5) / 2.5
        leans = smooth(np.minimum(phase / 0.25, (1 - phase) / 0.15)) * (t > 1)
        shift[:, :2] = -0.045 * leans[:, None] * SIDES[slot]
        sway, tilt = (x * (1 - 0.75 * leans)[:, None] for x in (sway, tilt))
        up = (phase - 0.25) / 0.6
        for k in range(4):
            lift[:, k] = smooth(np.minimum(up, 1 - up) / 0.12) * (slot == k) * (t > 1)
        size, height = np.array([0.03, 0.025, 0.02]), 0.05
    turn, angles = Rotation.from_rotvec(tilt).inv(), []
    for k, (x, y) in enumerate(SIDES):
        foot = np.array([0.19 * x, 0.14 * y, -0.29]) - sway - shift
        foot = foot + lift[:, [k]] * (size * wiggle[:, k] + [0, 0, height])
        angles.append(leg_angles(turn.apply(foot) - [0.19 * x, 0.05 * y, 0], 0.09 * y))
    return np.concatenate(angles, 1)


def leg_angles(foot: Array, side: float) -> Array:
    """Return the angles of a leg (N, 3) with its foot (N, 3) there from the hip [m]."""
    x, y, z = foot.T
    long = np.sqrt(np.maximum(y * y + z * z - side * side, 1e-6))
    knee = -2 * np.arccos(np.minimum(np.hypot(x, long), 0.4199) / 0.42)
    return np.stack(
        [np.arctan2(y, -z) - np.arctan2(side, long), np.arctan2(-x, long) - knee / 2, knee], 1
    )


def robot_text() -> str:
    """Return the shipped quadruped with feet."""
    text = (shipped_folder() / "quadruped/robot.xml").read_text(encoding="utf-8")
    for leg in LEGS:
        foot = (
            f'<geom name="{leg}_foot" type="sphere" size="{FOOT}" pos="0 0 -0.21" mass="0" '
            'contype="1" conaffinity="1" friction="0.8"/>'
        )
        calf = re.compile(rf'(<body name="{leg}_calf".*?)(\s*</body>)', re.DOTALL)
        text = calf.sub(rf"\1{foot}\2", text, count=1)
    return text


def walk(
    seed: int,
    kind: str,
    rate: float = RATE,
    seconds: float = 0.0,
    change: Callable[[mujoco.MjModel], None] | None = None,
) -> dict[str, Array]:
    """Return the motion of the quadruped, low-passed and sampled: its channels by name.

    For as long as its kind, unless `seconds` says otherwise; `change` makes another machine of it.
    """
    rng = np.random.default_rng(seed)
    text = robot_text()
    floor = '<geom name="floor" type="plane" size="5 5 1" contype="1" conaffinity="1"/>'
    text = re.sub(r'<position (name="\w+" joint="\w+")/>', r"<motor \1/>", text)
    text = re.sub(r"<keyframe>.*?</keyframe>|<position kp[^>]*/>", "", text, flags=re.DOTALL)
    m = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", "<worldbody>" + floor))
    m.opt.timestep, m.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    m.geom_solref[:], m.dof_solref[:] = [0.01, 1], [2 * STEP, 1]
    m.dof_solimp[:] = [0.99, 0.999, 0.001, 0.5, 2]
    if change is not None:
        change(m)
        mujoco.mj_setConst(m, mujoco.MjData(m))
    d = mujoco.MjData(m)
    t = np.arange(0, seconds or KINDS[kind], STEP)
    q = plan_legs(t, kind, rng)
    v = np.gradient(q, STEP, axis=0)
    d.qpos[3], d.qpos[7:], d.qpos[2] = 1.0, q[0], 0.31
    ends, force, rows = [m.geom(f"{leg}_foot").id for leg in LEGS], np.zeros(6), []
    feet = {geom: k for k, geom in enumerate(ends)}
    for k in range(len(t)):
        at = k - k % 2  # the servo runs at half the rate
        tau = GAINS[0] * (q[at] - d.qpos[7:]) + GAINS[1] * (v[at] - d.qvel[6:])
        d.ctrl[:] = np.clip(tau, -35, 35)
        before = np.concatenate([d.qpos, d.qvel])
        mujoco.mj_step(m, d)
        pushed = np.zeros((4, 6))
        for k_c, (first, second) in enumerate(d.contact.geom.tolist() if d.ncon else ()):
            mujoco.mj_contactForce(m, d, k_c, force)
            foot, side = (feet[second], 1.0) if second in feet else (feet[first], -1.0)
            world = side * d.contact.frame[k_c].reshape(3, 3).T @ force[:3]
            axes = d.geom_xmat[ends[foot]].reshape(3, 3).T
            x, y, z = d.contact.pos[k_c] - d.geom_xpos[ends[foot]]
            arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # np.cross takes long
            pushed[foot] += np.concatenate([axes @ world, axes @ (arm @ world)])
        turn = d.xmat[1].reshape(3, 3)
        acc = turn.T @ (d.qacc[:3] - m.opt.gravity)
        rows.append(np.concatenate([before[7:19], before[22:25], acc, d.ctrl, pushed.ravel()]))
    x = sosfiltfilt(butter(4, 0.4 * rate, fs=1 / STEP, output="sos"), np.array(rows), axis=0)
    every = round(1 / rate / STEP)
    ends = np.cumsum([12, 3, 3, 12])
    parts = np.split(x[::every], ends, axis=1)
    return dict(zip(("q", "gyro", "acc", "tau", "feet"), parts, strict=True)) | {"t": t[::every]}


def joint_columns(q: Array, tau: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return columns of the legs: encoders of 14 bits, noise of 2 % of the torque."""
    names = [f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf")]
    step, noise = 2 * np.pi / 2**14, 0.02 * tau.std(0) * rng.standard_normal(tau.shape)
    table = {f"{n}.q": np.round(q[:, k] / step) * step for k, n in enumerate(names)}
    return table | {f"{n}.tau": (tau + noise)[:, k] for k, n in enumerate(names)}


def walking_log(seed: int, kind: str, rate: float = RATE, *, wrenches: bool = True) -> pd.DataFrame:
    """Return a log of the walk, with flags of the feet and, if asked, their measured wrenches."""
    return table_of(walk(seed, kind, rate), np.random.default_rng(1000 + seed), wrenches)


def drawn_walk(
    seed: int, seconds: float, shares: Array, bias: Array, rate: float = 125.0
) -> tuple[pd.DataFrame, float]:
    """Return the log of another machine whose feet swing in turn, and its mass [kg].

    Its bodies are shares (13,) of the file's. Its inertial sensor has biases (6,) [m/s², rad/s].
    """
    masses = []

    def change(m: mujoco.MjModel) -> None:
        m.body_mass[1:] *= shares
        m.body_inertia[1:] *= shares[:, None]
        masses.append(float(m.body_mass.sum()))

    s = walk(seed, "swing", rate, seconds, change)
    s["acc"], s["gyro"] = s["acc"] + bias[:3], s["gyro"] + bias[3:]
    return table_of(s, np.random.default_rng(1000 + seed), wrenches=False), masses[0]


def table_of(s: dict[str, Array], rng: np.random.Generator, wrenches: bool) -> pd.DataFrame:
    """Return the motion as a log, with noise."""
    table = {"t": s["t"]} | joint_columns(s["q"], s["tau"], rng)
    table |= columns("base.acc.", s["acc"] + 0.05 * rng.standard_normal(s["acc"].shape))
    table |= columns("base.gyro.", s["gyro"] + 0.005 * rng.standard_normal(s["gyro"].shape))
    for k, leg in enumerate(LEGS):
        own = s["feet"][:, 6 * k : 6 * k + 6]
        table[f"{leg}_contact"] = (np.linalg.norm(own[:, :3], axis=1) > 1.0).astype(float)
        if not wrenches:
            continue
        own = own + 0.02 * own.std(0) * rng.standard_normal(own.shape)
        table |= columns(f"{leg}_f", own[:, :3]) | columns(f"{leg}_m", own[:, 3:])
    return pd.DataFrame(table)


if __name__ == "__main__":
    write_logs()
