"""Roll robots out along logged commands, and say by how much their positions err.

A robot file for a simulator is as good as its rollouts: the same commands from the same start,
servos as they are, and the error of positions, over whole logs (what drifts adds up) and over
windows of a second that begin with what was measured (what does not is seen there).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.rollouts import fit_rollouts, roll_late
from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import LogError, RobotError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected, checked
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import digits
from identifiability.foundation.rules import RuleTable, Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.tables import write_table
from identifiability.robot import Robot, RobotLike
from identifiability.robot.robot import new_place
from identifiability.robot.servo import state_delay
from identifiability.simulation.rollout import NO_SERVO, CommandedRobot, forgotten
from identifiability.simulation.rules import RULES as SIMULATION_RULES
from identifiability.workflows.answers import hides_joints, list_worst
from identifiability.workflows.opening import Logs
from identifiability.workflows.servo_gains import learn_gains, read_commanded
from identifiability.workflows.servo_limits import learn_limits

#: After how long a rollout begins anew with what was measured, in windows [s].
WINDOW: Tolerance = 1.0

Other = Annotated[
    Robot | Result | str | Path,
    Expected(
        "a Robot, a result of analyze or prune, or the path of a robot file or of a result's JSON"
    ),
]


@frozen
class Rolled:
    """A robot rolled out along logs.

    Attributes
    ----------
    name : str
        Of its file.
    delays : tuple of float [s]
        With which the commands of each log acted.
    found : bool
        Whether the delays were found, as no file states them.
    q : tuple of (N, n) [rad or m]
        Positions along each log; NaN where the rollout diverged.
    windows : tuple of (N, n) [rad or m]
        The same, begun anew at every window; NaN in a last one that is not whole.
    """

    name: str
    delays: tuple[float, ...]
    found: bool
    q: tuple[Array, ...]
    windows: tuple[Array, ...]


@frozen(kw_only=True)
class RolledOut(Result):
    """What robots do with logged commands. Make it with `rollout`.

    Attributes
    ----------
    robot : Robot
    logs : tuple of Log
    runs : tuple of Rolled
        Of the robot, of the fitted one, and of the other one, as far as there are.
    fitted : Robot or None
        With what was fitted to logs first; its `save` writes it.
    hints : tuple of str
        How logs were read, and what was mended in them.
    """

    schema: ClassVar[str] = "identifiability/rollout/1"

    robot: Robot
    logs: tuple[Log, ...]
    runs: tuple[Rolled, ...]
    fitted: Robot | None = None
    hints: tuple[str, ...] = ()

    @cached_property
    def errors(self) -> Array:
        """Errors of positions by run and joint over whole logs (rms), (runs, n); NaN: diverged.

        Without the beginning, in which the speed of the start is forgotten.
        """
        return self._errors("q")

    @cached_property
    def window_errors(self) -> Array:
        """The same over windows of a second."""
        return self._errors("windows")

    def _errors(self, which: str) -> Array:
        rows = []
        for run in self.runs:
            pairs = zip(getattr(run, which), self.logs, strict=True)
            skip = [forgotten(log) for log in self.logs]
            apart = [(x - log.q)[a:] for (x, log), a in zip(pairs, skip, strict=True)]
            every = np.concatenate(apart)
            if which == "windows":
                every = every[~np.isnan(every).all(1)]
            rows.append(np.sqrt(np.mean(every**2, axis=0)))
        return np.array(rows)

    @property
    def totals(self) -> Array:
        """Error of each run over all joints that turn, or if none does, slide (rms), (runs,)."""
        return np.asarray(np.sqrt(np.mean(self.errors[:, self.alike] ** 2, axis=1)))

    @property
    def window_totals(self) -> Array:
        """The same over windows of a second."""
        return np.asarray(np.sqrt(np.mean(self.window_errors[:, self.alike] ** 2, axis=1)))

    @property
    def alike(self) -> np.ndarray:
        """Which joints turn, or if none does, slide, (n,) bool: what errors are told of."""
        slides = np.array([self.robot.is_prismatic(int(k)) for k in self.robot.actuated], bool)
        return slides if slides.all() else ~slides

    @property
    def unit(self) -> str:
        """Of `totals`, a thousandth: mrad, or mm where every joint slides."""
        return "mm" if self.robot.is_prismatic(int(self.robot.actuated[self.alike][0])) else "mrad"

    @property
    def by_joint(self) -> str:
        """Errors of the last robot by joint, worst first, where that of all together hides them."""
        each = 1e3 * self.errors[-1, self.alike]
        if not hides_joints(each, np.inf):
            return ""
        joints = [j for j, a in zip(self.robot.joints, self.alike, strict=True) if a]
        of_last = f" of the robot {self.runs[-1].name}" if len(self.runs) > 1 else ""
        return f"By joint{of_last}: {list_worst(joints, each, self.unit)}."

    def answers(self) -> tuple[Answer, ...]:
        """Return by how much positions err, and how late commands act."""
        return _error(self), _delay(self)

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (SIMULATION_RULES,)

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint."""
        return (_joint_table(self),)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a joint: errors over whole logs and windows, of each robot [rad or m]."""
        frame = pd.DataFrame({"joint": list(self.robot.joints)})
        for run, whole, short in zip(self.runs, self.errors, self.window_errors, strict=True):
            frame[f"error of {run.name}"] = whole
            frame[f"{WINDOW:g} s windows of {run.name}"] = short
        return frame

    def positions_frame(self) -> pd.DataFrame:
        """Return positions sample by sample: log, t, and of each joint measured and simulated."""
        parts = []
        for k, log in enumerate(self.logs):
            columns: dict[str, Any] = {"log": log.name, "t": log.t}
            for i, joint in enumerate(log.joints):
                columns[f"{joint}.q"] = log.q[:, i]
                for r, run in enumerate(self.runs):
                    columns[f"{joint}.{run.name if r else 'simulated'}"] = run.q[k][:, i]
            parts.append(pd.DataFrame(columns))
        return pd.concat(parts, ignore_index=True)

    def write(self, path: str | Path) -> Path:
        """Write positions sample by sample as CSV or Parquet.

        Raises
        ------
        OutputError
        """
        return write_table(path, self.positions_frame())

    def to_dict(self) -> dict[str, Any]:
        """Return the answer in its documented JSON schema."""
        runs = [
            {
                "robot": run.name,
                "delays": list(run.delays),
                "delays_found": run.found,
                "error": _number(self.totals[k]),
                "error_windows": _number(self.window_totals[k]),
                "joints": {
                    joint: {"error": _number(a), "error_windows": _number(b)}
                    for joint, a, b in zip(
                        self.robot.joints, self.errors[k], self.window_errors[k], strict=True
                    )
                },
            }
            for k, run in enumerate(self.runs)
        ]
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "statement": self.statement,
            "logs": [
                {"name": log.path or log.name, "samples": len(log), "sha256": log.sha256}
                for log in self.logs
            ],
            "window": WINDOW,
            "rollouts": runs,
        }


def _number(x: float) -> float | None:
    """Return a number for JSON; what diverged has none."""
    return float(x) if np.isfinite(x) else None


@checked
def rollout(
    robot: RobotLike, logs: Logs, against: Other | None = None, fit: Logs = ()
) -> RolledOut:
    """Say by how much positions err where a robot is moved by logged commands.

    Parameters
    ----------
    robot : Robot, path or shipped name
        With servos, in its file or its sidecar. One that floats is put on a stand.
    logs : log, path, DataFrame, or several
        Logs with commands, ``<joint>.cmd``, beside positions; torque is not looked at.
    against : Robot, path or result, optional
        Another robot, or what analyze or prune fitted to this one.
    fit : the same as logs, optional
        Logs to whose positions rotors, friction and offsets of the joints, and the delay, are
        fitted first, bodies as the file's: that robot is the other one.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    with one_thread("blas"):
        robot = Robot.of(robot)
        robot.check_stands("rollout")
        if robot.servo is None:
            raise RobotError(f"{robot.path} {NO_SERVO}")
        read, said = read_commanded(robot, logs)
        if not read:
            raise LogError("No log was given; give at least one.")
        others = [] if against is None else [_other(robot, against)]
        learnt, more = read_commanded(robot, fit)
        if learnt:
            shared = {log.sha256 for log in learnt} & {log.sha256 for log in read}
            if shared:
                raise LogError(
                    f"{next(x.name for x in learnt if x.sha256 in shared)} is fitted and rolled "
                    "out; give logs that were not fitted."
                )
            robot = learn_limits(learn_gains(robot, learnt), learnt)
            assert robot.servo is not None
            found = fit_rollouts(robot, learnt, delay=robot.servo.delay)
            others.insert(0, robot.with_values(found.parameters(robot)))
        for other in others:
            if other.joints != robot.joints:
                raise RobotError(
                    f"{other.path} has the actuated joints {listing(other.joints)}, and "
                    f"{robot.path} {listing(robot.joints)}; compare robots with the same joints."
                )
        if others and robot.servo is not None and robot.servo.unknown.any():
            robot = replace(robot, servo=others[0].servo)
        runs = [_roll(each, read) for each in (robot, *others)]
        if learnt:
            runs[1] = replace(runs[1], name=f"fitted to {listing([x.name for x in learnt], 2)}")
        if against is not None and runs[-1].name == runs[0].name:
            runs[-1] = replace(runs[-1], name=f"{runs[-1].name} (the other)")
    return RolledOut(
        robot=robot,
        logs=tuple(read),
        runs=tuple(runs),
        fitted=others[0] if learnt else None,
        hints=tuple(dict.fromkeys((*said, *more))),
    )


def _name(robot: Robot) -> str:
    path = robot.path
    return path.name if path.stem != "robot" else f"{robot.name}/{path.name}"


def _other(robot: Robot, against: Other) -> Robot:
    """Return the other robot; a result is written as a robot file first."""
    if isinstance(against, Robot):
        return against
    if isinstance(against, Result):
        given = against.to_json(new_place("fitted", ".json"))
    else:
        given = Path(against)
    if given.suffix.lower() != ".json":
        return Robot.load(given)
    from identifiability.workflows.export import export  # noqa: PLC0415 - few rollouts are of results

    path = new_place(given.stem, robot.path.suffix)
    export(robot, given, path, force=True)
    return Robot.load(path)


def _roll(robot: Robot, logs: Sequence[Log]) -> Rolled:
    machine = CommandedRobot(robot, {})
    stated = machine.servo.delay
    late, whole = zip(*(roll_late(machine, log, stated) for log in logs), strict=True)
    pairs = list(zip(logs, late, strict=True))
    short = tuple(machine.roll(log, delay=d, windows=_windows(log))[0] for log, d in pairs)
    return Rolled(_name(robot), late, stated is None, whole, short)


def _windows(log: Log) -> list[tuple[int, int]]:
    """Return the rows of windows of some seconds; one, where a log is shorter."""
    rows = max(2, round(WINDOW / signals.sampling_step(log.t)))
    starts = range(0, len(log) - rows + 1, rows)
    return [(a, a + rows) for a in starts] or [(0, len(log))]


def _error(result: RolledOut) -> Answer:
    totals, unit = 1e3 * result.totals, result.unit
    texts = [f"{x:.3g} {unit}" if np.isfinite(x) else "it diverges" for x in totals]
    pairs = zip(result.runs, texts, 1e3 * result.window_totals, strict=True)
    text = " ".join(
        f"{run.name}: {x} over whole logs, {w:.3g} {unit} over windows of {WINDOW:g} s."
        for run, x, w in pairs
    )
    text = " ".join(filter(None, (text, result.by_joint)))
    short = " → ".join(texts)
    better = len(totals) > 1 and totals[1] < totals[0]
    tone = "blue" if len(totals) == 1 else "green" if better else "amber"
    return Answer("By how much do positions err?", f"{short[0].upper()}{short[1:]}.", text, tone)


def _delay(result: RolledOut) -> Answer:
    names = [log.name for log in result.logs]
    short = "; ".join(f"{r.name}: {state_delay(np.array(r.delays), names)}" for r in result.runs)
    found = any(run.found for run in result.runs)
    text = (
        "Found from these logs, as no file states it: it is that with which positions err least."
        if found
        else "As the files state it."
    )
    return Answer("When do commands act?", short, text, "blue")


def _joint_table(result: RolledOut) -> Table:
    """Return one row a joint."""
    own, cells = [Column("joint")], list[tuple[object, ...]]([result.robot.joints])
    for run, errors in zip(
        result.runs, zip(result.errors, result.window_errors, strict=True), strict=True
    ):
        titles = (run.name, f"{WINDOW:g} s windows")
        for title, each in zip(titles, errors, strict=True):
            own.append(Column(title, digits(3)))
            cells.append(tuple(1e3 * each))
    own.append(Column("unit"))
    cells.append(tuple("mm" if unit == "N" else "mrad" for unit in result.robot.torque_units))
    return Table.of("Each joint by itself", tuple(own), list(zip(*cells, strict=True)))
