"""Changes between logs of one robot.

The mixed model compares logs (`Differences`). Each possible change is a group that acts in some
logs only. Effects that all logs may lack are groups, too.
"""

from collections.abc import Iterator
from dataclasses import replace

from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.keyed import Row, name_estimates
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import checked
from identifiability.foundation.presenter import presented
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import REACH
from identifiability.foundation.runs import Run
from identifiability.foundation.values import Json, frozen
from identifiability.logs.commands import of_commands
from identifiability.logs.prepare import Preparation
from identifiability.quality.recordings import Logs, Recordings
from identifiability.regression.reduction import LadderLike, LadderSource, Submodel, build_ladder
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Motion, RobotLike

from .case import Case, Data, Use, follow, take_case
from .changes import (
    Change,
    DifferentTorque,
    FeltTorque,
    Unchanged,
    list_lacks,
    list_log_changes,
    list_unchanged,
)
from .roles import may_divide
from .sides import Sides, find_changes, list_days

# The logs of a comparison.

#: All logs count, with torque or with commands.
SIDES = Use(divides=False)


def read_sides(case: Case, run: Run, *, commands: bool = False) -> Recordings:
    """Return the logs of a case, of which fitted and held-out ones are two sides.

    Parameters
    ----------
    case : Case
    run : Run
    commands : bool
        Whether torque may come from commands.

    Raises
    ------
    LogError
        If a log stands on both, or torque comes from commands and must not.
    """
    try:
        sides = case.recordings(run)
    except LogError as error:
        if error.key in ("twice.held", "twice.rows"):
            raise LogError(Finding("twice.sides")) from None
        raise
    commanded = [any(map(of_commands, side)) for side in (sides.fitted, sides.held_out)]
    if any(commanded) and not (commands and all(commanded)):
        raise LogError(Finding("sides.commands"))
    return sides


def compute_sides(case: Case, structure: Structure, run: Run) -> tuple[Recordings, Structure]:
    """Return both sides with torque of their servos, and the structure with these servos.

    Torque of commands is corrected by rollouts. Each side has its own, as rollouts with friction of
    the side before would hide a change. Both have the gains of the side before.
    """
    sides, known = case.torque(structure, run)
    if not sides.commanded:
        return sides, known
    from identifiability.servos import replace_servo  # noqa: PLC0415 - MuJoCo

    servo = known.robot.servo
    assert servo is not None  # commands make torque
    literal = case.recordings(run)
    own = replace(literal, fitted=literal.held_out, held_out=(), hints=())
    how = case.common_preparation(structure.robot, literal)
    same = replace(known, robot=replace(known.robot, servo=replace(servo, found="", kept=True)))
    after, other = case.stages.once(follow, own, same, how, run.seed, say=run.say)
    own_servo = other.robot.servo
    assert own_servo is not None
    held_out = tuple(replace_servo(log, own_servo, servo) for log in after.fitted)
    return replace(sides, held_out=held_out, hints=(*sides.hints, *after.hints)), known


# `Comparison`: the changes as numbers.


@frozen(kw_only=True)
class Comparison(OfStructure, Result):
    """Changes between logs, made by `compare`.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    submodel : Submodel
        The model.
    before, after : tuple of str
        Logs on either side.
    days : tuple of str
        Days on which they began (UTC), those before first; empty where their times are no dates.
    changes : tuple of Change
        The surest first.
    limits : tuple of Unchanged
        What else may change at each joint and body, and its least change that would be named.
    lacks : tuple of str
        Effects that the model lacks in all logs.
    hints : tuple of str
    preparation : Preparation
        Requested preparation of the logs.
    motion, torque : Motion and DifferentTorque
        Of the log after that changed most.
    source : LadderSource
        Where its model came from.
    verifiable : bool
        Whether the logs before are enough for `diagnose`, which verifies on a part of them.
    """

    schema = "identifiability/comparison/1"

    structure: Structure
    submodel: Submodel
    before: Strings
    after: Strings
    days: Strings
    changes: tuple[Change, ...]
    limits: tuple[Unchanged, ...]
    lacks: Strings
    hints: Strings
    preparation: Preparation
    motion: Motion
    torque: DifferentTorque
    source: LadderSource
    verifiable: bool

    @property
    @presented
    def answer(self) -> str:
        """The changes, in one sentence."""
        raise NotImplementedError

    @property
    def unchanged(self) -> tuple[Unchanged, ...]:
        """Numbers that did not change."""
        loaded = {change.place for change in self.changes if change.kind == "load"}
        return tuple(x for x in self.limits if x.kind != "load" or x.place not in loaded)

    def rows_by_name(self) -> Iterator[Row]:
        """Yield one row a number that changed; the surest change of a name stands last."""
        for change in reversed(self.changes):
            columns = (change.names, change.sizes.tolist(), change.sd.tolist(), change.units)
            reason = f"{change.called}: log odds {change.odds:.3g}."
            details = {"what": change.what, "kind": change.kind, "log_odds": change.odds}
            told = {"verdict": "changed", "reason": reason, "details": details}
            yield from name_estimates(zip(*columns, strict=True), **told)

    def explain_absence(self, name: str) -> str:
        """Return that a parameter did not change, and from which size a change would be seen."""
        told = "no change of it was found between these logs"
        for number in self.unchanged:
            if number.name == name:
                return f"{told}; {number.least:.2g} {number.unit} would have been seen."
        if name in self.structure.columns:
            return f"{told}."
        return ""

    def to_dict(self) -> Json:
        """Return the comparison in the documented JSON schema."""
        own = ["statement", "before", "after", "days"]
        named = {name: getattr(self, name) for name in own}
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.submodel.name,
            **named,
            "changed": bool(self.changes),
            "changes": [_change_record(c) for c in self.changes],
            "unchanged": [_unchanged_record(x) for x in self.unchanged],
        }


def _change_record(change: Change) -> Json:
    """Return a change with its numbers, the torque of it, and competing hypotheses."""
    size, sd = change.relative
    columns = (change.names, change.units, change.sizes, change.sd)
    rows = zip(*columns, strict=True)
    numbers = [
        {"name": name, "unit": unit, "change": x, "low": x - REACH * s, "high": x + REACH * s}
        for name, unit, x, s in rows
    ]
    return {
        "what": change.what,
        "kind": change.kind,
        "place": change.place,
        "log": change.log,
        "since": change.since,
        "within_seconds": change.seconds if change.within else None,
        "sessions": [_interval(*point.relative) for point in change.course],
        "log_odds": change.odds,
        "share": _interval(size, sd),
        "torque": _interval(change.felt.rms, change.felt.sd) | _joint_of(change.felt),
        "numbers": numbers,
        "parts": [_change_record(part) for part in change.parts],
        "or": [_change_record(other) for other in change.alternatives],
    }


def _unchanged_record(number: Unchanged) -> Json:
    """Return a number that did not change, with the least change that would be named."""
    return {
        "what": number.what,
        "kind": number.kind,
        "place": number.place,
        "name": number.name,
        "unit": number.unit,
        "seen_from": number.least,
        "seen_from_share": number.relative,
        "seen_from_torque": {"size": number.felt.rms, **_joint_of(number.felt)},
    }


def _interval(size: float, sd: float) -> dict[str, float]:
    return {"size": size, "low": size - REACH * sd, "high": size + REACH * sd}


def _joint_of(felt: FeltTorque) -> dict[str, str]:
    return {"joint": felt.joint, "unit": felt.unit}


# `compare`: changes between logs of one robot.


@checked
def compare(
    robot: RobotLike | Case,
    before: Logs = (),
    after: Logs = (),
    *,
    ladder: LadderLike | None = None,
    preparation: Preparation | None = None,
    engine: Engine | None = None,
) -> Comparison:
    """Find changed loads, friction, springs, offsets and gains; of three logs also the changed one.

    The comparison allows for effects that the model lacks in all logs. Only the logs of `before`
    determine how columns are read, and the cut-off.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        Of a case, the fitted logs are those before, and the held-out logs those after.
    before, after : log, path, DataFrame, or several
        With columns as for `analyze`.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is the one that logs are compared under; by default the ladder of the case
        or of the robot's folder, else all base parameters with torque offsets.
    preparation : Preparation, optional
        How derivatives are made.
    engine : Engine, optional
        Where logs that are too long for memory are processed.

    Raises
    ------
    LogError
        If a log does not fit the robot, or is on both sides, or a side has no log.
    """
    run = Run(engine=engine or Serial())
    with one_thread("blas"):
        case = take_case(robot, before, after, preparation, SIDES)
        source = case.ladder(ladder, beside=True)
        recordings = read_sides(case, run, commands=True)
        first = case.first_structure(run, ladder)
        sides_read, structure = compute_sides(case, first, run)
        data = case.data(structure, run, "compared", recordings=sides_read)
        unchanged = case.completed(data, run)
        if unchanged.unseen is None:
            raise LogError(Finding("sides.one"))
        every = unchanged.unseen.followed_by(unchanged.regression)
        sides = Sides(len(unchanged.validation), every)
        submodel = build_ladder(source.entry, unchanged.structure)[0]
        found, terms = find_changes(sides, unchanged.structure, submodel)
        changes = list_log_changes(found, terms, sides.names)
        base = found.known.base
        pairs = zip(unchanged.structure.base.names, base.tolist(), strict=True)
        times = {name: (x, float("nan")) for name, x in pairs if name.endswith((".delay", ".lead"))}
        hints = (*_check_reading(case, unchanged, base, run), *unchanged.remarks(times))
        torque = DifferentTorque.of(found, terms, len(unchanged.validation))
    later, earlier = sides.paths
    days = list_days(sides.samples, recordings.began)
    in_order = (*days[sides.count :], *days[: sides.count])
    return Comparison(
        structure=unchanged.structure,
        submodel=submodel,
        before=earlier,
        after=later,
        days=in_order,
        changes=changes,
        limits=list_unchanged(found, terms),
        lacks=list_lacks(found, terms),
        hints=hints,
        preparation=case.preparation or Preparation(),
        motion=sides.samples[torque.log].motion,
        torque=torque,
        source=source,
        verifiable=may_divide(recordings.fitted),
    )


def _check_reading(case: Case, data: Data, base: Array, run: Run) -> list[Finding]:
    """Return which logs after contradict the reading of the logs before.

    Parameters
    ----------
    case : Case
    data : Data
        Under this reading; held-out logs are those after.
    base : (b,)
        Values of its base parameters, by the logs before.
    run : Run
    """
    carried = data.recordings.reading
    if carried is None:
        return []
    literal = case.data(carried.structure, run, seek=False)
    return carried.find_contradictions(data.structure, base, data.validation, literal.validation)
