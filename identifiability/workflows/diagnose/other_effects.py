"""Effects that a simulator does not have, along stretches of motion that go on from logs.

What an effect says of a state may depend on more than that state: on the time of the log and of
its session, and on the way that led there. Both are those of the log until a stretch begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects.effect import Effect, Family
from identifiability.foundation.names import Array
from identifiability.logs.prepare.samples import join_motions
from identifiability.robot import Motion, Robot, complete_motion


class OtherEffects:
    """What a model has and MuJoCo does not: an `Extra`, asked at every step, one after the other.

    Parameters
    ----------
    robot : Robot
    effects : sequence of (effect, family, values)
        With the values of its parameters (p,).
    starts : sequence of (motion, row)
        Logs that stretches go on from, and where they begin in them, in order.
    """

    def __init__(
        self,
        robot: Robot,
        effects: Sequence[tuple[Effect, Family, Array]],
        starts: Sequence[tuple[Motion, int]],
    ) -> None:
        self._robot, self._effects = robot, effects
        self._begun = np.array([motion.t[row] for motion, row in starts])
        self._sessions = [motion.start for motion, _ in starts]
        remembered = any(family.remembers for _, family, _ in effects)
        self._ways = _ways_to(robot, starts) if remembered else []

    def __call__(
        self, which: np.ndarray, later: float, q: Array, dq: Array, ddq: Array
    ) -> tuple[Array, Array]:
        """Return torque and dry friction at the states of some stretches, (K, n) each.

        Parameters
        ----------
        which : (K,) int
        later : float [s]
            Since they began.
        q, dq, ddq : (K, n)
        """
        every = complete_motion(self._robot, self._begun[which] + later, q, dq, ddq)
        sessions: dict[float | None, list[int]] = {}  # a motion has one place in its session
        for place, row in enumerate(every.kept):
            sessions.setdefault(self._sessions[which[row]], []).append(place)
        torque, level = np.zeros_like(q), np.zeros_like(q)
        for start, at in sessions.items():
            rows, now = every.kept[at], replace(every[np.array(at)], start=start)
            way, last = self._go_on(which[rows], now) if self._ways else (now, np.arange(len(now)))
            for effect, family, values in self._effects:
                motion, there = (way, last) if family.remembers else (now, np.arange(len(now)))
                W = np.zeros((len(motion), q.shape[1], len(values)))
                effect.fill(self._robot, motion, W)
                (level if family.dry else torque)[rows] += W[there] @ values
        return torque, level * np.sign(dq)

    def _go_on(self, which: np.ndarray, now: Motion) -> tuple[Motion, np.ndarray]:
        """Return the ways of stretches as runs of one motion, and where they are now, (K,)."""
        for at, k in enumerate(which):
            self._ways[k] = keep_turns(self._robot, _join([self._ways[k], now[at : at + 1]]))
        parts = [self._ways[k] for k in which]
        ends = np.cumsum([len(part) for part in parts])
        motion = _join(parts)
        apart = np.searchsorted(ends, np.arange(len(motion)), side="right")
        return replace(motion, kept=motion.kept + apart), ends - 1


def keep_turns(robot: Robot, way: Motion) -> Motion:
    """Return of a way what can be remembered of it: its ends, and turns that nothing later reaches.

    Play and stop, and all that is made of them, forget the others [Brokate & Sprekels 1996]. What
    led to the first sample they take from where an axis begins to move.
    """
    if len(way) < 3:
        return way
    axes = (*robot.axes, *robot.passive_axes)
    x = np.column_stack([robot.travel(axis, way.q) for axis in axes])
    v = np.column_stack([robot.along(axis, way.v) for axis in axes])
    turns = np.diff(np.sign(np.diff(x, axis=0)), axis=0) != 0
    extreme = np.zeros(turns.shape, bool)
    for most, exceeds in ((np.maximum, np.greater), (np.minimum, np.less)):
        extreme |= exceeds(x[1:-1], most.accumulate(x[:1:-1])[::-1])
    kept = np.concatenate([[True], (turns & extreme).any(1), [True]])
    kept[np.argmax(v != 0, axis=0)] = True
    return way[np.flatnonzero(kept)]


def _ways_to(robot: Robot, starts: Sequence[tuple[Motion, int]]) -> list[Motion]:
    """Return what can be remembered of the log at each start, as far as no sample is missing."""
    ways: list[Motion] = []
    before: tuple[Motion | None, int] = None, 0
    for motion, row in starts:
        gaps = np.flatnonzero(np.diff(motion.kept[: row + 1]) != 1)
        first = int(gaps[-1]) + 1 if len(gaps) else 0
        goes_on = before[0] is motion and first <= before[1]
        way = _join([ways[-1], motion[before[1] : row]]) if goes_on else motion[first:row]
        ways.append(keep_turns(robot, way))
        before = motion, row
    return ways


def _join(parts: Sequence[Motion]) -> Motion:
    """Return motions as one, the next after the last."""
    whole = join_motions(parts)
    return replace(whole, kept=np.arange(len(whole)))
