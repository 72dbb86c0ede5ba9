"""Effects of gears, belts and screws: play, presliding, friction that grows with load, ripple."""

import numpy as np

from identifiability.foundation.linalg import TINY, without_rounding
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Motion, Robot
from identifiability.robot.closure import tabulated_torque

from .effect import POSTURES, Along, AlongAxes, Shaped, Span, once_along, split_runs
from .nominal import needs_masses, rigid_torque
from .registry import declare

# Memory of a joint for its path since it turned: play and stop [Brokate & Sprekels 1996].
#
# Both hang on the path alone, not on time. Where samples are missing, and at the first of a
# stretch, the joint is taken to have come a long way in the direction that it moves in.


def follow_with_play(x: Array, width: float, way: float) -> Array:
    """Return where a slider is that x drags along in a slot from ``-width`` to ``width``, (N,).

    Clips after clips are a clip, so that all of them are composed in log₂ N rounds, or in fewer:
    once each has met both ends of the slot, where it began no longer matters.

    Parameters
    ----------
    x : (N,) [rad or m]
    width : float [rad or m]
    way : float
        Sign of the direction in which x came to its first sample.
    """
    low = x - width
    high = x + width
    step = 1
    while step < len(x) and not np.array_equal(low[step:], high[step:]):
        ends = [np.clip(end[:-step], low[step:], high[step:]) for end in (low, high)]
        changes = zip((low, high), ends, strict=True)
        low, high = (np.concatenate([end[:step], new]) for end, new in changes)
        step *= 2
    return np.clip(x[0] - width * way, low, high)


def stretch_of_springs(motion: Motion, position: Array, speed: Array, width: float) -> Array:
    """Return the relative deflection of a spring that slips beyond ``width``, (N,), −1 … 1.

    Parameters
    ----------
    motion : Motion
    position, speed : (N,)
        Of an axis along it.
    width : float [rad or m]
    """
    out = np.zeros(len(position))
    for rows in split_runs(motion):
        x = position[rows]
        way = np.sign(speed[rows])
        first = float(way[np.argmax(way != 0)])
        out[rows] = (x - follow_with_play(x, width, first)) / width
    return out


# Friction that builds up over the way after each reversal: presliding, hysteresis.


#: Ways of the elements over the shape.
ELEMENTS = tuple(2.0**k for k in range(3))


@declare(
    "presliding hysteresis",
    shapes=lambda span: tuple(s * span.position_range for s in (0.003, 0.01, 0.03, 0.1)),
    needs="coulomb_friction",
    remembers=True,
    told_by="reverse often, after short ways and after long ones",
)
class Hysteresis(Shaped):
    """``τ = Σ Hₖ zₖ``, springs that slip: generalised Maxwell slip, linear in its levels.

    Each element is a spring that slips when it is stretched by rₖ: z moves from −1 to 1 with the
    distance after a reversal. The three ways are the shape r [rad or m] times 1, 2 and 4. Beyond
    them it is Coulomb friction.
    """

    name = "hysteresis"
    equation = "τ = Σ Hₖ zₖ(q), zₖ ← clip(zₖ + Δq/rₖ, ±1)"
    source = "[Iwan 1966; Al-Bender 2005]"
    of_drive = True
    units = tuple((f"H{k + 1}", "N·m", "N") for k in range(len(ELEMENTS)))
    usual = (0.01, 0.001)
    nonnegative = True
    stated_as = ("frictionloss",) * len(ELEMENTS)  # beyond their ways
    limits = ("coulomb_friction", "joint_stiffness")

    def curves(self, at: Along) -> list[Array]:
        """Return the relative deflection of each spring."""
        r = self.shape(at.robot, at.axis)
        return [stretch_of_springs(at.motion, at.travel, at.speed, r * k) for k in ELEMENTS]


# Coulomb friction in proportion to the load of the gear.


def carried_load(load: Array, at: Along) -> Array:
    """Return the load (N,) of an axis that alone carries joint torques (N, n)."""
    row = at.load
    carried_along = (load * row).sum(1)
    squares = np.maximum((row * row).sum(-1), TINY**2)
    carried = carried_along / squares
    return without_rounding(carried[:, None], load)[:, 0]


@once_along
def rigid_load(at: Along) -> Array:
    """Return the load (N,) of an axis that alone carries the nominal masses and known torques."""
    springs = tabulated_torque(at.robot, at.motion, beyond=True)
    return carried_load(rigid_torque(at.robot, at.motion) + springs, at)


@declare(
    "load-dependent friction",
    needs="coulomb_friction",
    refuse=needs_masses,
    loaded=True,
)
class LoadDependentFriction(AlongAxes):
    """``τ = Fl |τ_load| sign(q̇)``.

    The load is the rigid-body torque that the fitted masses predict, plus known torques. So a
    column does not contain measured torque. Where the load hardly changes it looks like Coulomb
    friction.
    """

    name = "load_dependent_friction"
    equation = "τ = Fl |τ_load| sign(q̇)"
    source = "[Hamon 2010, Eq. 4]"
    of_drive = True
    units = (("Fl", "1", "1"),)
    nonnegative = True

    anywhere = False

    def curves(self, at: Along) -> list[Array]:
        """Return the load against the motion."""
        return [np.abs(rigid_load(at)) * at.sign]


# Load that a motor does not feel while it crosses the play of its gear.


@declare(
    "backlash of a gear",
    shapes=lambda span: tuple(s * span.position_range for s in (0.003, 0.01, 0.03)),
    refuse=needs_masses,
    loaded=True,
    remembers=True,
    told_by="reverse under load and without",
)
class Backlash(Shaped):
    """``τ = −Bl τ_load min(1, 10 (1 − |z|))``: an indicator of play, not a model of it.

    After each reversal the motor crosses the play of its gear, where teeth do not touch and none of
    the load is felt; z moves from −1 to 1 after a reversal, over twice the shape w [rad or m]. The
    load is by the fitted masses. A log of the motor alone does not contain more.
    """

    name = "backlash"
    equation = "τ = −Bl τ_load min(1, 10 (1 − |z(q)|)), z ← clip(z + Δq/w, ±1)"
    source = "[Nordin & Gutman 2002]"
    units = (("Bl", "1", "1"),)
    usual = (0.005, 0.0005)
    nonnegative = True

    anywhere = False

    def curves(self, at: Along) -> list[Array]:
        """Return the load that is not felt."""
        width = self.shape(at.robot, at.axis)
        z = stretch_of_springs(at.motion, at.travel, at.speed, width)
        # Teeth touch again within a tenth of the play: encoders tremble where they do.
        return [-np.minimum(10.0 * (1.0 - np.abs(z)), 1.0) * rigid_load(at)]


# Torque that repeats with the pitch of a screw, the teeth of a gear or the poles of a motor.


#: Periods in the range of a joint that are tried: of one that turns, and of one that slides, whose
#: motor may have many poles. Below two it is a spring or gravity; neighbours are in phase to a
#: quarter of a period over the range.
RIPPLES = tuple(0.5 * np.arange(4, end) for end in (33, 97))


def _list_periods(span: Span) -> tuple[float, ...]:
    """Return the periods that are tried [rad or m]."""
    slides = {axis.name: axis.prismatic for axis in span.robot.axes}
    turning, sliding = RIPPLES
    counts = sliding if slides[span.joint] else turning
    return tuple((span.position_range / counts).tolist())


@declare(
    "position ripple",
    shapes=_list_periods,
    refined=True,
    against="position",
    told_by=POSTURES,
)
class PositionRipple(Shaped):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)``: cogging, screw pitch, gear teeth.

    Its shape is the period λ [rad or m], by default a sixth of the joint's range.
    A period as long as the range looks like a spring or like gravity.
    """

    name = "position_ripple"
    equation = "τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)"
    source = "[Tuttle & Seering 1996; Bittencourt 2012, Sec. 3]"
    units = (("Rs", "N·m", "N"), ("Rc", "N·m", "N"))

    def curves(self, at: Along) -> list[Array]:
        """Return sine and cosine."""
        phase = 2 * np.pi * at.travel / self.shape(at.robot, at.axis)
        return [np.sin(phase), np.cos(phase)]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a sixth of the range of an axis, or a typical period [rad or m]."""
        at = [a.name for a in robot.axes].index(axis.name)
        low, high = robot.limits[at] if at < len(robot.limits) else (-np.inf, np.inf)
        if np.isfinite(high - low):
            return float(high - low) / 6
        return 0.03 if axis.prismatic else np.pi / 6


# Torque that repeats with each turn of the motor.


def gear_ratio(robot: Robot, place: str) -> float:
    """Return the turns of a motor for one of its joint [1 or rad/m]; nan where it is unknown."""
    gears = robot.transmission
    if gears is not None:
        for name, row, ratio in zip(gears.motors, gears.coupling, gears.ratio, strict=True):
            (used,) = np.nonzero(row)
            alone = robot.motor_joints[used[0]] == place if len(used) == 1 else False
            if (name == place or alone) and abs(ratio) != 1:
                return float(abs(ratio) * (abs(row[used[0]]) if alone else 1.0))
    ratio = robot.torque.at("ratio", place)
    return float("nan") if ratio is None else abs(ratio)


def _turns(span: Span) -> tuple[float, ...]:
    turn = 2 * np.pi / gear_ratio(span.robot, span.joint)
    # Waves in a turn of the motor that are tried: its own, those of a strain wave gear, its
    # poles.
    return tuple(turn / k for k in (1, 2, 4, 6))


def _unknown(robot: Robot, place: str) -> str:
    if np.isfinite(gear_ratio(robot, place)):
        return ""
    return "the robot's sidecar states no gear ratio there ([transmission] or [torque] ratio)"


@declare(
    "ripple of a motor's turns",
    shapes=_turns,
    refuse=_unknown,
    against="position",
    told_by="run slowly through the whole range",
)
class GearRipple(PositionRipple):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)`` with λ a turn of the motor, or a part of it.

    Its shape is λ [rad or m] at the joint; the gear ratio determines it. It is far shorter than the
    wavelengths that a diagnosis of `position_ripple` tries.
    """

    name = "gear_ripple"
    equation = "τ = Ms sin(2π q/λ) + Mc cos(2π q/λ), λ = 2π/ratio/k, k = 1, 2, 4, 6"
    source = "[Tuttle & Seering 1996]"
    units = (("Ms", "N·m", "N"), ("Mc", "N·m", "N"))

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a turn of the motor, or of the joint where the ratio is not known."""
        return float(2 * np.pi / np.nan_to_num(gear_ratio(robot, axis.name), nan=1.0))
