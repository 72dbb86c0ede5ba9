"""What can be mended in logs: it is mended when they are read, in this order, and said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.mend import drop_contradictions, drop_stuck, mend_logs, unwrap_logs
from identifiability.logs.prepare import Preparation
from identifiability.logs.repeats import Recording, drop_repeats
from identifiability.robot.servo import Servo
from identifiability.workflows.oddities.check import CHECKS, Does, check


@frozen
class Reading:
    """Logs that are being read.

    Attributes
    ----------
    fitted, held_out : tuple of Log or LogFile
    how : Preparation or None
        How they will be prepared.
    servo : Servo or None
        Of the robot.
    hints : tuple of str
        What was mended.
    speeds : tuple of (N, n) or None
        Of logs of commands those that were measured, in order; their torque is made without.
    learns : bool
        Whether something is learnt of the rows, so that each counts once.
    """

    fitted: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    how: Preparation | None = None
    servo: Servo | None = None
    hints: tuple[str, ...] = ()
    speeds: tuple[Array | None, ...] = ()
    learns: bool = True

    def by(
        self, mend: Callable[[Sequence[Recording]], tuple[list[Recording], tuple[str, ...]]]
    ) -> Reading:
        """Return the logs, each mended by itself."""
        every, hints = mend([*self.fitted, *self.held_out])
        n = len(self.fitted)
        return self.having(every[:n], every[n:], hints)

    def having(
        self, fitted: Sequence[Recording], held_out: Sequence[Recording], hints: Sequence[str] = ()
    ) -> Reading:
        """Return the same of other logs, with what is said of them."""
        said = (*self.hints, *hints)
        return replace(self, fitted=tuple(fitted), held_out=tuple(held_out), hints=said)


def mend(logs: Reading) -> Reading:
    """Return logs with everything mended that can be, and each mend said."""
    for one in CHECKS:
        if one.does is Does.MENDS:
            logs = one.find(logs)
    return logs


@check(
    "what stands still in motion",
    Does.MENDS,
    200,
    says="… in every row, while the robot moves: it was not measured, and the equations of …",
    means="A sensor was not connected or hung, or the logger wrote its last row again.",
    do="Look at the column and the rows that are named. A motor that is switched off has torque, "
    "too: that of its gear's friction, which this joint's parameters are then not known of.",
)
def drop_still(logs: Reading) -> Reading:
    """Leave out torque, and rows, that stand still while the robot moves."""
    return logs.by(drop_stuck)


@check(
    "angles within one turn",
    Does.MENDS,
    201,
    says="…: angles jump by a whole turn (…)",
    means="The positions were written within one turn, from −180° to 180° or from 0 to 360°.",
    do="Nothing: they are read as going on.",
)
def unwrap(logs: Reading) -> Reading:
    """Undo the jumps of wrapped angles."""
    return logs.by(unwrap_logs)


@check(
    "wrong samples",
    Does.MENDS,
    202,
    says="…: … far from those before and after, as no motion or torque does, and …",
    means="Single values were lost or garbled on the bus.",
    do="Look at the rows that are named; many of them are a sensor or a bus to mend.",
)
def replace_wrong(logs: Reading) -> Reading:
    """Replace wrong samples by what those beside them say."""
    return logs.by(mend_logs)


@check(
    "commands without torque",
    Does.MENDS,
    203,
    says="… commands and no torque: it is what the servos of … make of them, …",
    means="Torque is what the stated position servos make of the commands, late by what is said.",
    do="Nothing, if gains and delay are the servos'; `[servo]` in the sidecar states them.",
)
def compute_torque(logs: Reading) -> Reading:
    """Compute torque of commands; how late they act is found, and said, when they are followed."""
    servo = logs.servo
    if servo is None:
        return logs
    from identifiability.workflows.commanded import give_torque  # noqa: PLC0415 - MuJoCo

    before = (*logs.fitted, *logs.held_out)
    given = logs.by(lambda every: (give_torque(every, servo), ()))
    after = (*given.fitted, *given.held_out)
    pairs = zip(before, after, strict=True)
    return replace(
        given,
        speeds=tuple(b.dq if of_commands(a) and isinstance(b, Log) else None for b, a in pairs),
    )


@check(
    "derivatives that contradict their positions",
    Does.MENDS,
    204,
    says="The … of … were not used, but computed: …",
    means="A velocity or acceleration column is of another joint, late, or filtered until little "
    "of the motion is left.",
    do="Leave the column out, or give the right one; `--set derivatives=given` uses it as it is.",
)
def drop_contradicting(logs: Reading) -> Reading:
    """Leave out derivatives that contradict positions, unless the given ones are asked for."""
    asked = logs.how is not None and logs.how.derivatives == "given"
    return logs if asked else logs.by(drop_contradictions)


@check(
    "repeated rows",
    Does.MENDS,
    205,
    says="… repeats rows that were given before, noise and all (…)",
    means="A file was given twice, tiled, or cut from another: the same noise is no new evidence.",
    do="Give each measurement once. A held-out log that only repeats fitted ones is refused.",
)
def count_once(logs: Reading) -> Reading:
    """Leave out rows that came before; measured speeds tell repetitions from copies."""
    if not logs.learns:
        return logs
    every: list[Recording] = [*logs.fitted, *logs.held_out]
    for k, speed in enumerate(logs.speeds):
        if isinstance(log := every[k], Log) and speed is not None:
            every[k] = replace(log, dq=speed)
    *kept, hints = drop_repeats(every[: len(logs.fitted)], every[len(logs.fitted) :])
    fitted, held_out = (
        [x.without(("dq",)) if of_commands(x) else x for x in some] for some in kept
    )
    return logs.having(fitted, held_out, hints)
