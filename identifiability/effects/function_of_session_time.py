"""Torque that depends on the time of the session in a way that has no name here."""

from collections.abc import Sequence

from identifiability.effects.effect import Along
from identifiability.effects.family import Span
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import DEGREE, SmoothFunction, straight_beyond
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Motion, Robot

#: Pieces of the session, of which each takes several logs: one that is left out leaves no hole.
PIECES = 2
#: Logs of which one may be left out.
FEWEST = 3
#: Duration where none is given [s].
TYPICAL = 600.0


def time_of_session(motion: Motion) -> Array:
    """Return the time since the session began, (N,) [s]; that of the log where none is known."""
    return motion.t if motion.start is None else motion.t + motion.start


def has_session(motions: Sequence[Motion]) -> bool:
    """Whether motions share a clock that says more than the time within each.

    That is where logs say when they began, and so many that one may be left out: two must be left
    to say how it goes on.
    """
    starts = {m.start for m in motions}
    return len(starts) >= FEWEST and None not in starts


def end_of_session(span: Span) -> tuple[float, ...]:
    """Return the end of the time of the fitted session [s]; nothing where logs share no clock."""
    if not has_session(span.motions):
        return ()
    return (max(float(time_of_session(m).max(initial=0.0)) for m in span.motions) or TYPICAL,)


@declare(
    "an unnamed function of the time of the session",
    shapes=end_of_session,
    against="session",
    unnamed=True,
    flexible=True,
    told_by="log the same motion later in the session",
    rank=34.5,
)
class FunctionOfSessionTime(SmoothFunction):
    """``τ = f(T)`` of the time since the first log of a session began: warming up, for one.

    Its shape is the end of that time [s]. Logs are pieces of a session with pauses between, of
    which the last is seldom fitted: so the function is held to a straight line as closely as the
    motion says, and goes straight on beyond its end.
    """

    name = "function_of_session_time"
    equation = "τ = f(T), f = Σ cₖ Bₖ(T)"
    units = (("fT", "N·m", "N"),)
    usual = (TYPICAL, TYPICAL)

    def coordinate(self, at: Along) -> Array:
        """Return the time of the session, from −1 to 1."""
        return 2.0 * time_of_session(at.motion) / self.shape(at.robot, at.axis) - 1.0

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline."""
        del robot, axis
        return self.numbered(PIECES + DEGREE)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        return list(straight_beyond(self.coordinate(at), PIECES).T)
