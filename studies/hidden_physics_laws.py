"""Hidden effects of `hidden_physics_cases.py`, with a name, or as physics makes them.

Sizes are drawn as machines have them, in units of the joint's own friction, torque, speed and
range; shapes are drawn continuously. Errors of recording (delays, gains, leaks) change the record.
Effects that turn gravity or add a mass change the model, and all others are a `Law`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from hidden_physics import Law, Rule, State

from identifiability.foundation.names import Array


@dataclass(frozen=True)
class Joint:
    """Motion statistics of an axis: units for its hidden effects.

    Attributes
    ----------
    axis : int
    dry, viscous : float [N·m or N; N·m·s/rad or N·s/m]
    torque : float [N·m or N]
        Root mean square.
    speed, fastest : float [rad/s or m/s]
    low, high : float [rad or m]
    other : int
        Another actuated joint, if there is one.
    other_speed, other_torque : float
        Root mean squares of it.
    seconds : float [s]
        Length of a log.
    """

    axis: int
    dry: float
    viscous: float
    torque: float
    speed: float
    fastest: float
    low: float
    high: float
    other: int
    other_speed: float
    other_torque: float
    seconds: float

    @property
    def middle(self) -> float:
        """Middle of the range."""
        return 0.5 * (self.low + self.high)

    @property
    def range(self) -> float:
        """Length of the range."""
        return self.high - self.low


@dataclass(frozen=True)
class Hidden:
    """What is hidden.

    Attributes
    ----------
    family : str
        Public name; of what the dictionary does not have, ours.
    law : Law, optional
    shape : float or None
        As the family counts it.
    numbers : dict
        What else was drawn, by name.
    record : callable(tau (L, N, n), at (N,), times (N,)) -> (L, N, n), optional
        What is recorded instead of a torque.
    """

    family: str
    law: Law | None = None
    shape: float | None = None
    numbers: dict[str, Any] = field(default_factory=dict)
    record: Callable[[Array, float], Array] | None = None


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _simple(
    j: Joint,
    force: Callable[[State, Array, Array], Array] | None = None,
    level: Callable[[State, Array, Array], Array] | None = None,
) -> Law:
    """Return a law without memory: a force and a level by state, position and speed."""

    def begin(_runs: int) -> Rule:
        def rule(s: State) -> tuple[Array | float, Array | float, Array | float]:
            q, v = s.q[:, j.axis], s.v[:, j.axis]
            both = 0.0 if level is None else level(s, q, v)
            return (0.0 if force is None else force(s, q, v)), both, both

        return rule

    return Law(j.axis, begin)


def _elements(j: Joint, levels: Array, ways: Array, less: float = 0.0) -> Law:
    """Return springs that slip: with levels (K,) beyond ways (K,), in place of dry friction."""

    def begin(runs: int) -> Rule:
        z, last = np.zeros((runs, len(ways))), np.full(runs, np.nan)

        def rule(s: State) -> tuple[Array, float, float]:
            nonlocal z, last
            step = np.where(np.isnan(last), 0.0, s.q[:, j.axis] - last)
            last = s.q[:, j.axis]
            z = np.clip(z + step[:, None] / ways, -1.0, 1.0)
            return z @ levels, -less, -less

        return rule

    return Law(j.axis, begin)


def _smooth(rng: np.random.Generator, j: Joint) -> Callable[[Array], Array]:
    """Return a smooth random function over the range, of rms one."""
    a, b = rng.standard_normal((2, 3)) / np.arange(1, 4)
    k = np.arange(1, 4) * np.pi * rng.uniform(0.7, 1.3)
    grid = np.linspace(-1, 1, 200)[:, None]

    def bare(x: Array) -> Array:
        return np.sin(x[:, None] * k) @ a + np.cos(x[:, None] * k) @ b

    size, mean = float(np.std(bare(grid[:, 0]))), float(np.mean(bare(grid[:, 0])))
    return lambda q: (bare(2 * (q - j.middle) / j.range) - mean) / size


Draw = Callable[[np.random.Generator, Joint], Hidden]


def _stribeck(rng: np.random.Generator, j: Joint) -> Hidden:
    vs, a = j.speed * _log(rng, 0.05, 0.6), j.dry * rng.uniform(0.3, 1.2)
    law = _simple(j, level=lambda _s, _q, v: a * np.exp(-np.abs(v) / vs))
    return Hidden("stribeck_friction", law, vs, {"Fs": a})


def _rising(rng: np.random.Generator, j: Joint) -> Hidden:
    vr, a = j.speed * _log(rng, 0.08, 0.8), j.dry * rng.uniform(0.4, 0.9)
    law = _simple(j, level=lambda _s, _q, v: -a * np.exp(-np.abs(v) / vr))
    return Hidden("rising_friction", law, vr, {"Fr": a})


def _sigmoid(rng: np.random.Generator, j: Joint) -> Hidden:
    vt, a = j.speed * _log(rng, 0.15, 1.2), j.dry * rng.uniform(0.4, 1.2)
    law = _simple(j, lambda _s, _q, v: a * np.tanh(v / vt))
    return Hidden("sigmoid_friction", law, vt, {"Ft": a})


def _asymmetry(rng: np.random.Generator, j: Joint) -> Hidden:
    a = j.dry * rng.uniform(0.2, 0.5) * rng.choice([-1, 1])
    law = Law(j.axis, lambda _runs: lambda _s: (0.0, a, -a))
    return Hidden("coulomb_asymmetry", law, None, {"half difference": a})


def _offset(rng: np.random.Generator, j: Joint) -> Hidden:
    a = j.torque * rng.uniform(0.03, 0.15) * rng.choice([-1, 1])
    return Hidden("torque_offset", _simple(j, lambda _s, _q, v: np.full_like(v, a)), None, {"o": a})


def _quadratic(rng: np.random.Generator, j: Joint) -> Hidden:
    a = j.torque * rng.uniform(0.05, 0.3) / j.fastest**2
    law = _simple(j, lambda _s, _q, v: a * v * np.abs(v))
    return Hidden("quadratic_friction", law, None, {"F2": a})


def _stiffness(rng: np.random.Generator, j: Joint) -> Hidden:
    k = j.torque * rng.uniform(0.05, 0.3) / (0.5 * j.range)
    law = _simple(j, lambda _s, q, _v: k * q)
    return Hidden("joint_stiffness", law, None, {"k": k})


def _free_spring(rng: np.random.Generator, j: Joint) -> Hidden:
    k = j.torque * rng.uniform(0.05, 0.3) / (0.5 * j.range)
    rest = j.middle + j.range * rng.uniform(0.3, 0.8) * rng.choice([-1, 1])
    law = _simple(j, lambda _s, q, _v: k * (q - rest))
    return Hidden("free_spring", law, None, {"k": k, "rest": rest})


def _gravity_spring(rng: np.random.Generator, j: Joint) -> Hidden:
    a, phase = j.torque * rng.uniform(0.05, 0.3), rng.uniform(0, 2 * np.pi)
    law = _simple(j, lambda _s, q, _v: a * np.sin(q + phase))
    return Hidden("gravity_spring", law, None, {"amplitude": a, "phase": phase})


def _load(rng: np.random.Generator, j: Joint) -> Hidden:
    a = rng.uniform(0.05, 0.25)
    law = _simple(j, level=lambda s, _q, _v: a * np.abs(s.load[:, j.axis]))
    return Hidden("load_dependent_friction", law, None, {"Fl": a})


def _ripple(rng: np.random.Generator, j: Joint) -> Hidden:
    period, phase = j.range * _log(rng, 0.04, 0.4), rng.uniform(0, 2 * np.pi)
    a = j.torque * rng.uniform(0.02, 0.1)
    law = _simple(j, lambda _s, q, _v: a * np.sin(2 * np.pi * q / period + phase))
    return Hidden("position_ripple", law, period, {"amplitude": a})


def _position_friction(rng: np.random.Generator, j: Joint) -> Hidden:
    f, a = _smooth(rng, j), j.dry * rng.uniform(0.2, 0.5)
    law = _simple(j, level=lambda _s, q, _v: a * f(q))
    return Hidden("position_friction", law, None, {"rms": a})


def _position_torque(rng: np.random.Generator, j: Joint) -> Hidden:
    f, a = _smooth(rng, j), j.torque * rng.uniform(0.03, 0.15)
    return Hidden("position_torque", _simple(j, lambda _s, q, _v: a * f(q)), None, {"rms": a})


def _hysteresis(rng: np.random.Generator, j: Joint) -> Hidden:
    r = j.range * _log(rng, 0.004, 0.08)
    levels = j.dry * rng.uniform(0.4, 1.2) * rng.dirichlet(np.ones(3))
    law = _elements(j, levels, r * np.array([1.0, 2.0, 4.0]))
    return Hidden("hysteresis", law, r, {"levels": levels.tolist()})


def _torque_drift(rng: np.random.Generator, j: Joint) -> Hidden:
    d = j.torque * rng.uniform(0.03, 0.15) / j.seconds * rng.choice([-1, 1])
    law = _simple(j, lambda s, _q, _v: d * (s.t - 0.5 * j.seconds))
    return Hidden("torque_drift", law, None, {"d": d})


def _friction_drift(rng: np.random.Generator, j: Joint) -> Hidden:
    g, h = rng.uniform(-0.6, -0.2, 2) / j.seconds
    law = _simple(
        j,
        lambda s, _q, v: g * s.t * j.viscous * v,
        lambda s, _q, _v: h * s.t * j.dry,
    )
    return Hidden("friction_drift", law, None, {"dv": g * j.viscous, "dc": h * j.dry})


def _velocity_leak(rng: np.random.Generator, j: Joint) -> Hidden:
    c = j.torque * rng.uniform(0.03, 0.15) / j.other_speed * rng.choice([-1, 1])
    law = _simple(j, lambda s, _q, _v: c * s.v[:, j.other])
    return Hidden("velocity_leak", law, float(j.other + 1), {"by": c})


def _torque_leak(rng: np.random.Generator, j: Joint) -> Hidden:
    c = j.torque / j.other_torque * rng.uniform(0.03, 0.12) * rng.choice([-1, 1])

    def record(tau: Array, _rate: float) -> Array:
        out = tau.copy()
        out[:, :, j.axis] += c * tau[:, :, j.other]
        return out

    return Hidden("torque_leak", None, float(j.other + 1), {"leak": c}, record)


def _torque_scale(rng: np.random.Generator, j: Joint) -> Hidden:
    s = rng.uniform(0.05, 0.2) * rng.choice([-1, 1])

    def record(tau: Array, _rate: float) -> Array:
        out = tau.copy()
        out[:, :, j.axis] *= 1 + s
        return out

    return Hidden("torque_scale", None, None, {"scale": s}, record)


def _late(family: str, way: int) -> Draw:
    def draw(rng: np.random.Generator, j: Joint) -> Hidden:
        late = way * rng.uniform(2e-3, 12e-3)

        def record(tau: Array, rate: float) -> Array:
            t, out = np.arange(tau.shape[1]) / rate, tau.copy()
            for k in range(len(tau)):
                out[k, :, j.axis] = np.interp(t - late, t, tau[k, :, j.axis])
            return out

        return Hidden(family, None, None, {"late": late}, record)

    return draw


def _passive(rng: np.random.Generator, j: Joint) -> Hidden:
    c, v = j.torque * rng.uniform(0.1, 0.5), j.torque * rng.uniform(0.1, 0.5)

    def begin(_runs: int) -> Rule:
        return lambda s: (v / j.speed * s.v[:, j.axis], c, c)

    return Hidden("passive_joint_friction", Law(j.axis, begin), None, {"Fc": c, "Fv": v / j.speed})


def _tilt(rng: np.random.Generator, _j: Joint) -> Hidden:
    angle, way = _log(rng, 0.01, 0.06), rng.uniform(0, 2 * np.pi)
    return Hidden("gravity_tilt", None, None, {"angle": angle, "direction": way})


#: Effects with a name, by their draw.
INSIDE: dict[str, Draw] = {
    "stribeck_friction": _stribeck,
    "rising_friction": _rising,
    "sigmoid_friction": _sigmoid,
    "coulomb_asymmetry": _asymmetry,
    "torque_offset": _offset,
    "quadratic_friction": _quadratic,
    "joint_stiffness": _stiffness,
    "free_spring": _free_spring,
    "gravity_spring": _gravity_spring,
    "load_dependent_friction": _load,
    "position_ripple": _ripple,
    "position_friction": _position_friction,
    "position_torque": _position_torque,
    "hysteresis": _hysteresis,
    "torque_drift": _torque_drift,
    "friction_drift": _friction_drift,
    "velocity_leak": _velocity_leak,
    "torque_leak": _torque_leak,
    "torque_scale": _torque_scale,
    "time_delay": _late("time_delay", 1),
    "clock_error": _late("clock_error", -1),
    "passive_joint_friction": _passive,
    "gravity_tilt": _tilt,
}


def _lugre(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return bristles with a Gaussian Stribeck curve, in place of dry friction [Canudas 1995]."""
    vs, a = j.speed * _log(rng, 0.05, 0.4), j.dry * rng.uniform(0.3, 1.0)
    s0 = (j.dry + a) / (j.range * _log(rng, 0.002, 0.02))
    s1 = 0.3 * s0 * vs / j.fastest * 0.05

    def begin(runs: int) -> Rule:
        z = np.zeros(runs)

        def rule(s: State) -> tuple[Array, float, float]:
            nonlocal z
            v = s.v[:, j.axis]
            g = j.dry + a * np.exp(-((v / vs) ** 2))
            new = (z + 1e-3 * v) / (1 + 1e-3 * s0 * np.abs(v) / g)
            rate, z = (new - z) / 1e-3, new
            return s0 * z + s1 * rate, -j.dry, -j.dry

        return rule

    return Hidden("lugre", Law(j.axis, begin), vs, {"Fs": a, "stiffness": s0})


def _maxwell(rng: np.random.Generator, j: Joint) -> Hidden:
    ways = j.range * np.sort(np.exp(rng.uniform(np.log(0.003), np.log(0.15), 6)))
    levels = j.dry * rng.uniform(0.8, 1.5) * rng.dirichlet(np.full(6, 2.0))
    law = _elements(j, levels, ways, less=0.8 * j.dry)
    return Hidden("maxwell_slip", law, None, {"ways": ways.tolist(), "levels": levels.tolist()})


def _warm_up(rng: np.random.Generator, j: Joint) -> Hidden:
    last, g, h = rng.uniform(20, 90), rng.uniform(0.4, 1.5), rng.uniform(0.2, 0.8)
    law = _simple(
        j,
        lambda s, _q, v: g * j.viscous * np.exp(-s.session / last) * v,
        lambda s, _q, _v: h * j.dry * np.exp(-s.session / last),
    )
    return Hidden("warm_up", law, last, {"viscous": g, "dry": h})


def _belt(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return a mass behind a belt that swings."""
    w, zeta = 2 * np.pi * rng.uniform(1.5, 5.0), rng.uniform(0.03, 0.15)
    inertia = 0.3 * j.torque / (2 * np.pi * 0.5 * j.speed) * rng.uniform(0.2, 0.6)

    def begin(_runs: int) -> Rule:
        x: Array | None = None
        v: Array = np.zeros(1)

        def rule(s: State) -> tuple[Array, float, float]:
            nonlocal x, v
            q, rate = s.q[:, j.axis], s.v[:, j.axis]
            if x is None:
                x, v = q.copy(), rate.copy()
            pull = w * w * (q - x) + 2 * zeta * w * (rate - v)
            v = v + 1e-3 * pull
            x = x + 1e-3 * v
            return inertia * pull, 0.0, 0.0

        return rule

    return Hidden("belt_resonance", Law(j.axis, begin), w / 2 / np.pi, {"inertia": inertia})


def _harmonics(rng: np.random.Generator, j: Joint) -> Hidden:
    first = j.range * _log(rng, 0.1, 0.5)
    orders = np.array([1.0, 2.0, 3.0, 4.0]) * 2 * np.pi / first
    sizes = j.torque * rng.uniform(0.02, 0.08) * rng.uniform(0.3, 1.0, 4)
    phases = rng.uniform(0, 2 * np.pi, 4)
    law = _simple(j, lambda _s, q, _v: np.sin(q[:, None] * orders + phases) @ sizes)
    return Hidden("harmonics", law, first, {"sizes": sizes.tolist()})


def _hose(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return a hose that is bent at one end and taut at the other."""
    a, taut = j.torque * rng.uniform(0.05, 0.25), rng.uniform(-0.2, 0.6)
    way, steep = rng.choice([-1, 1]), rng.uniform(0.2, 0.8)

    def force(_s: State, q: Array, _v: Array) -> Array:
        x = way * 2 * (q - j.middle) / j.range
        out: Array = way * a * (np.maximum(x - taut, 0) ** 1.5 - steep * np.exp(-3 * (x + 1)))
        return out

    return Hidden("hose", _simple(j, force), None, {"size": a, "taut": taut})


def _brake(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return a brake that drags for some seconds of the second log."""
    begin, last = j.seconds * rng.uniform(0.1, 0.5), j.seconds * rng.uniform(0.15, 0.4)
    a = j.dry * rng.uniform(0.5, 1.5)

    def level(s: State, _q: Array, v: Array) -> Array:
        on = (s.t > begin) & (s.t < begin + last) & (np.arange(len(v)) == 1)
        return a * on

    numbers = {"Fc": a, "from": begin, "to": begin + last, "log": 1}
    return Hidden("brake", _simple(j, level=level), None, numbers)


def _grip(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return a mass that is gripped in the middle of the second log and kept to its end."""
    numbers = {"share": rng.uniform(0.1, 0.5), "from": j.seconds * rng.uniform(0.3, 0.7), "log": 1}
    return Hidden("grip", None, None, numbers)


def _saturation(rng: np.random.Generator, _j: Joint) -> Hidden:
    """Return a motor that gives less torque than is commanded and recorded."""
    return Hidden("saturation", None, None, {"limit": _log(rng, 1.3, 5.0)})


def _cable_drag(rng: np.random.Generator, j: Joint) -> Hidden:
    """Return a cable that is dragged: stiff, and with friction that is not the same everywhere."""
    f, a, k = _smooth(rng, j), j.dry * rng.uniform(0.15, 0.4), j.torque * rng.uniform(0.02, 0.1)
    law = _simple(
        j,
        lambda _s, q, _v: k * np.tanh(2 * (q - j.middle) / j.range),
        lambda _s, q, _v: a * (1 + f(q)),
    )
    return Hidden("cable_drag", law, None, {"dry": a, "stiff": k})


#: Functions of one joint.
_OWN = ("function_of_velocity", "function_of_position", "function_of_load")
_TWO = ("function_of_velocity_and_load", "function_of_position_and_velocity")
_TIME = ("function_of_time", "function_of_session_time", "function_of_velocity_and_time")
_SPRINGS = ("position_torque", "joint_stiffness", "free_spring")
#: Effects without a name: their draw, and the names and functions in their joint that would
#: describe them.
OUTSIDE: dict[str, tuple[Draw, tuple[str, ...]]] = {
    "lugre": (_lugre, ("stribeck_friction", "hysteresis", _OWN[0], *_TWO)),
    "maxwell_slip": (_maxwell, ("hysteresis", _OWN[0], *_TWO)),
    "warm_up": (_warm_up, ("friction_drift", *_TIME, _OWN[0])),
    "belt_resonance": (_belt, (*_OWN, *_TWO, *_TIME)),
    "harmonics": (_harmonics, ("position_ripple", "gear_ripple", "position_torque", _OWN[1])),
    "hose": (_hose, (*_SPRINGS, "gravity_spring", _OWN[1], _TWO[1])),
    "brake": (_brake, ("coulomb_friction", *_TIME)),
    "grip": (_grip, ("payload", *_TIME)),
    "saturation": (_saturation, ("torque_scale", _OWN[2], _TWO[0])),
    "cable_drag": (_cable_drag, ("position_friction", "hysteresis", *_SPRINGS, *_OWN[:2], _TWO[1])),
}
