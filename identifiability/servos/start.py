"""The robot and numbers with which the search for rollouts begins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects.vocabulary import drop_follower_friction
from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.logs import Log, signals
from identifiability.logs.commands import acting
from identifiability.robot import Robot
from identifiability.robot.servo import Servo
from identifiability.simulation.rollout import COARSE, STEP, CommandedRobot, starting_speeds

from .positions import encoder_noise
from .problem import RolloutProblem
from .standing import find_standing
from .windows import Window

#: Natural frequencies of a servo and its load that are tried [rad/s].
FREQUENCIES = np.geomspace(2, 250, 17)


def start_rollouts(
    robot: Robot, windows: Sequence[Window]
) -> tuple[CommandedRobot, dict[str, Array]]:
    """Return a robot and joints' numbers from which the search begins.

    The file's numbers are used if all gains are known and the file follows the logs as well as a
    command that is merely delayed. Otherwise each joint takes the best of a grid of natural
    frequencies and damping ratios: files without rotors and damping do not follow at all.
    """
    servo = robot.servo
    assert servo is not None
    kp = np.where(np.isnan(servo.kp), 1.0, servo.kp)
    ki = np.where(np.isnan(servo.integral), kp, servo.integral)
    kv = np.where(np.isnan(servo.kv), servo.kp == 0, servo.kv)
    guess = replace(servo, kp=kp, kv=kv, ki=ki)
    plain = drop_follower_friction(robot)
    machine = CommandedRobot(robot, plain, guess)
    delay = servo.delay or 0.0
    balanced, unknown_scale = balance_torque(machine, servo, windows, delay)
    stands = ~np.any([window.moves for window in windows], axis=0)
    numbers = machine.numbers()
    scaled = guess.having(balanced)
    settled = settle_joints(machine, {**numbers, "kp": scaled.kp, "kv": scaled.kv}, stands)

    def with_standing(one: Mapping[str, Array]) -> dict[str, Array]:
        return {kind: np.where(stands, settled[kind], x) for kind, x in one.items()}

    numbers = with_standing(numbers)
    if not servo.unknown.any() and np.all(_errors(machine, numbers, delay, windows) < 1):
        return machine, numbers
    held = find_held(CommandedRobot(robot, plain, scaled), windows)
    tried = [numbers, with_standing(hold_by_friction(balanced, held))]
    errors = np.array([_errors(machine, one, delay, windows) for one in tried])
    if np.any(errors[-1] >= 1):
        known = servo if unknown_scale else servo.having(servo.by_gain(scaled.gain))
        listed = _list_numbers(machine, known, windows[0].rows)
        grid = [with_standing(hold_by_friction(one, held)) for one in listed]
        of_grid = [_errors(machine, one, delay, windows) for one in grid]
        tried = [*tried, *grid]
        errors = np.array([*errors, *of_grid])
    best = errors.argmin(0)
    chosen = {
        kind: np.array([one[kind] for one in tried])[best, range(len(best))] for kind in numbers
    }
    chosen["ki"] = np.where(np.isnan(servo.integral), chosen["kp"], ki)
    return CommandedRobot(robot, plain, guess.having(chosen)), chosen


def settle_joints(
    machine: CommandedRobot, numbers: Mapping[str, Array], joints: np.ndarray
) -> dict[str, Array]:
    """Return joints' numbers with which some joints, (n,) bool, settle where the file states none.

    Logs do not determine the numbers of joints whose commands stand. A link without rotor and
    friction would ring, a light one faster than rollouts step. It gets those of a servo that
    settles within two coarse steps.
    """
    step = COARSE * STEP
    kp = numbers["kp"]
    needed = np.maximum(kp * step**2 - machine.bare, 0.0)
    is_light = joints & (needed > numbers["Ia"])
    is_bare = joints & (numbers["Ia"] + numbers["Fv"] + numbers["Fc"] + numbers["kv"] == 0)
    damping = np.maximum(2.0 * kp * step - numbers["kv"], numbers["Fv"])
    settled = {"Ia": needed, "Fv": damping}
    changes = is_light | is_bare
    return {kind: np.where(changes, settled.get(kind, x), x) for kind, x in numbers.items()}


def find_held(machine: CommandedRobot, windows: Sequence[Window]) -> Array:
    """Return how far dry friction holds joints off commands that stand, (n,) [rad or m].

    It is zero where too few commands stand.
    """
    sources = {window.log: window.source for window in windows}
    each = find_standing(machine, [*sources.values()])
    return np.array([max(rests.split()[1], 0.0) if rests.is_judged else 0.0 for rests in each])


def hold_by_friction(numbers: Mapping[str, Array], held: Array) -> dict[str, Array]:
    """Return joints' numbers with dry friction that holds joints off commands, (n,) [rad or m]."""
    return {**numbers, "Fc": np.maximum(numbers["Fc"], numbers["kp"] * held)}


def restart_joints(problem: RolloutProblem, x: Array, joints: np.ndarray) -> Array:
    """Return a vector in which some joints begin again, from the best of the grid.

    The other joints and the delays keep their numbers. A joint that begins again with an unknown
    gain gets the median gain of the others, and the friction that holds it off its commands.

    Parameters
    ----------
    problem : RolloutProblem
    x : (p,)
    joints : (n,) bool
    """
    numbers, _ = problem.unpack(x)
    machine = problem.machine
    before = machine.servo.having(numbers).gain
    usual = np.median(before if joints.all() else before[~joints])
    gain = np.where(joints & problem.varied[problem.at("kp")], usual, before)
    known = machine.servo.having(machine.servo.by_gain(gain))
    plain = drop_follower_friction(machine.robot)
    held = find_held(CommandedRobot(machine.robot, plain, known), problem.windows)
    grid = _list_numbers(machine, known, problem.logs[0])
    held_grid = (hold_by_friction(one, held) for one in grid)
    tried = [x, *(problem.replace_numbers(x, one, joints) for one in held_grid)]
    shares = np.array([problem.missed(problem.roll([one], COARSE * STEP)[0]) for one in tried])
    best = shares.argmin(0)
    begun = x.copy()
    for joint in np.flatnonzero(joints):
        of_joint = slice(joint, problem.over.size, len(joints))
        begun[of_joint] = tried[best[joint]][of_joint]
    return begun


def _errors(
    machine: CommandedRobot, numbers: Mapping[str, Array], delay: float, windows: Sequence[Window]
) -> Array:
    """Return errors of positions as shares of the explicable motion, (n,): means over windows.

    A joint counts where its command moves.
    """
    # Few robots need a short step.
    step = machine.longest(numbers, COARSE * STEP)
    logs = [window.rows for window in windows]
    sources = [window.source for window in windows]
    rolled = machine.roll_all(logs, numbers, [delay] * len(logs), step, sources)
    pairs = zip(rolled, logs, strict=True)
    errors = [np.sqrt(np.mean((q - log.q) ** 2, axis=0)) for q, log in pairs]
    sizes = np.array([window.explicable for window in windows])
    shares = np.nan_to_num(errors / sizes, nan=1e6)
    moves = np.array([window.moves for window in windows])
    weighted = np.sum(shares * moves, axis=0)
    counts = np.maximum(moves.sum(0), 1)
    return weighted / counts


def balance_torque(
    machine: CommandedRobot, servo: Servo, windows: Sequence[Window], delay: float
) -> tuple[dict[str, Array], bool]:
    """Return joints' numbers by least squares, and whether no gain has a scale.

    The squares are those of the servo's law, one joint at a time.

    The torque kp (q_cmd − q), or kv (dq_cmd − dq), is that of gravity, inertia, viscous and dry
    friction. An unknown gain is the one with which gravity is the file's. Joints that feel no
    gravity get the median gain.

    Parameters
    ----------
    machine : CommandedRobot
    servo : Servo
        In which unknown gains are NaN.
    windows : sequence of Window
    delay : float [s]
    """
    rows = [_balance_rows(machine, window, delay) for window in windows]
    late, v, a, gravity, moves = (np.concatenate(x) for x in zip(*rows, strict=True))
    numbers = machine.numbers()
    unknown = np.isnan(servo.gain)
    slope = np.zeros((4, v.shape[1]))
    for j in np.flatnonzero(moves.any(0)):
        used = moves[:, j]
        signs = np.sign(v[used, j])
        motion = [signs, v[used, j], a[used, j]]
        if unknown[j]:
            target = late[used, j]
            columns = np.stack([*motion, gravity[used, j]], axis=1)
        else:
            target = servo.gain[j] * late[used, j] - gravity[used, j]
            columns = np.stack([*motion, np.ones(used.sum())], axis=1)
        slope[:, j] = np.linalg.lstsq(columns, target, rcond=None)[0]
    # Gravity that moves a joint by less than the noise of positions does not determine its gain.
    turned = slope[3] * np.sqrt(np.mean(gravity**2, axis=0))
    noise = [encoder_noise(window.rows) for window in windows]
    # An integral replaces the error of position that gravity needs.
    integrates = np.isnan(servo.integral) | (servo.integral > 0)
    told = unknown & (turned > np.max(noise, axis=0)) & ~integrates
    gains = np.where(told, 1 / or_one(slope[3]), np.nan)
    usual = float(np.nanmedian(gains)) if told.any() else 1.0
    # About an upright axis hardly any gravity is left, whose slope is that of other torque.
    felt = np.sqrt(np.mean(gravity**2, axis=0)) / usual
    told &= felt > np.max(noise, axis=0)
    gains = np.where(unknown, np.where(told, gains, usual), servo.gain)
    factor = np.where(unknown, gains, 1.0)
    dry, viscous, inertia, offset = factor * slope
    bodies = machine.inertia(windows[0].rows.q.mean(0)) - numbers["Ia"]
    rotor = np.maximum(inertia - bodies, 0.0)
    damping = np.maximum(viscous - machine.servo.kv * (servo.kp != 0), 0.0)
    friction = np.maximum(dry, 0.0)
    offsets = np.where(unknown, 0.0, offset)
    balanced = {
        **numbers,
        "Ia": rotor,
        "Fv": damping,
        "Fc": friction,
        "off": offsets,
        **machine.servo.by_gain(gains),
    }
    return balanced, bool(unknown.all() and not told.any())


def _balance_rows(machine: CommandedRobot, window: Window, delay: float) -> tuple[Array, ...]:
    """Return late motion, speed, acceleration, gravity, and where a joint moves, (N, n) each."""
    log = window.rows
    dt = signals.sampling_step(log.t)
    v = starting_speeds(log)
    followed = np.where(machine.servo.kp == 0, v, log.q)
    late = acting(log, machine.servo, log.t, dt, delay) - followed
    fast = np.abs(v) > 0.5 * np.sqrt(np.mean(v**2, axis=0))
    moves = fast & window.moves
    return late, v, np.gradient(v, dt, axis=0), machine.gravity(log.q), moves


def _list_numbers(machine: CommandedRobot, servo: Servo, log: Log) -> Iterator[Mapping[str, Array]]:
    """Yield joints' numbers of each natural frequency and damping ratio.

    A known gain and a frequency determine an inertia. Where no gain is known, the inertia is the
    file's.
    """
    unknown = np.isnan(servo.gain)
    order = np.where(servo.kp == 0, 1, 2)
    inertia = machine.inertia(log.q.mean(0))
    numbers = machine.numbers()
    bodies = inertia - numbers["Ia"]
    # If the file lacks a rotor, the search starts from the largest inertia of all joints.
    stated = np.where(numbers["Ia"] > 0, inertia, inertia.max())
    highest = np.pi / signals.sampling_step(log.t)
    for frequency in FREQUENCIES[highest > FREQUENCIES]:
        needed = np.maximum(servo.gain / frequency**order, bodies)
        total = np.where(unknown, stated, needed)
        gain = np.where(unknown, stated * frequency**order, servo.gain)
        gains = machine.servo.by_gain(gain)
        for ratio in (0.2, 0.5, 1.0, 2.0, 4.0):
            damping = np.maximum(2 * total * frequency * ratio - gains["kv"], 0.0)
            yield {**numbers, "Ia": total - bodies, "Fv": damping, **gains}
