"""The pages of results: for each kind its title, the drawing at its answers, and its sections.

Functions of a result make the parts of its page. ``<kind>_heading`` returns kind and subject,
``<kind>_moving`` and ``<kind>_below`` the drawings at the answers, then come ``<kind>_notes`` and
``<kind>_sections``. All are optional: without, a page shows answers and tables alone. The functions
of an `Analysis` and a `Ladder` are in `identifiability.report.analysis`, those of positions in
`identifiability.report.rollouts`. Verbs are imported inside the functions: a page needs only its
verb.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.effects import title_of
from identifiability.foundation.answers import Column, Note
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array, Strings, shorten_paths
from identifiability.foundation.rounding import (
    NONE,
    REACH,
    format_count,
    format_number,
    join,
    rough_percent,
)
from identifiability.robot import complete_motion
from identifiability.robot.kinematics import Point

from .analysis import section_parameters, section_values
from .answers.common import NAMED, capital, hint_note, sentence, words
from .answers.compare import list_loaded
from .answers.diagnose import shorten_title
from .answers.predict import moves_worse
from .answers.tables import make_table, unit_cell
from .blocks import (
    SHOWN_FIRST,
    Block,
    Fold,
    Moving,
    Picture,
    Prose,
    Section,
    Term,
    Terms,
    Traces,
    count_joints,
    gallery,
    motion_traces,
    picture,
    section,
    torque_lines,
    torque_traces,
    traces,
)
from .figures import draw_curve, draw_forward, draw_intervals, draw_response, name_torque
from .skeleton import STRETCH, move_skeletons, move_with_torque

if TYPE_CHECKING:
    from identifiability.bending import Bending
    from identifiability.robot import Robot
    from identifiability.workflows.calibrate.calibration import Calibration
    from identifiability.workflows.compare import Comparison
    from identifiability.workflows.diagnose.forward import ForwardGap
    from identifiability.workflows.diagnose.result import Curve, Diagnosis, Odds
    from identifiability.workflows.excite.result import Excitation
    from identifiability.workflows.inspect import Inspection, Record
    from identifiability.workflows.payload import Load
    from identifiability.workflows.predict import TorquePrediction


# Calibration: may intervals and verdicts be trusted on this motion?


def calibration_heading(calibration: Calibration) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    return "Calibration", f"{calibration.analysis.robot.path.name} · {calibration.model}"


def calibration_below(calibration: Calibration) -> Picture:
    """Return the coverage of the parameters whose intervals hold the truth least often."""
    frame = calibration.to_frame()[:SHOWN]
    share, low, high = 100 * frame[["value", "low", "high"]].to_numpy(float).T
    reach = np.maximum([share - low, high - share], 0.0)
    label = "intervals that hold the truth [%]"
    return picture(
        "each",
        draw_intervals(
            list(frame["parameter"]),
            share,
            reach,
            label,
            95.0,
        ),
    )


def calibration_sections(calibration: Calibration) -> list[Section]:
    """Return the sections of the page."""
    trials = len(calibration.cell.held)
    texts = words("calibration.how", trials=trials, seed=calibration.provenance["seed"])
    return [
        section("calibration.parameters", *calibration.tables()),
        section("calibration.method", Prose(tuple(texts.values()))),
    ]


# Comparison: what changed between logs.


def comparison_heading(result: Comparison) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    every, k = _name_logs(result), len(result.before)
    before, after = (join(logs, 3, "logs") for logs in (every[:k], every[k:]))
    about = f"{result.robot.path.name} · {_name_model(result.submodel.name)}"
    return "Comparison report", f"{about} · before:\xa0{before} · after:\xa0{after}"


def _name_logs(result: Comparison) -> list[str]:
    """Return the names of all logs, each with its day if it is known."""
    names = shorten_paths((*result.before, *result.after))
    days = (f" ({day})" if day else "" for day in result.days)
    return list(map("".join, zip(names, days, strict=True)))


def comparison_moving(result: Comparison) -> Moving | None:
    """Return the robot along the later log that changed most, over the torque that did."""
    torque = result.torque
    lines = {"measured": torque.measured}
    if result.changes:
        lines["explained"] = torque.explained
    log, _ = shorten_paths((result.after[torque.log], result.before[0]))
    load = _place_load(result)
    about = result.robot, result.motion, torque.t, torque.whole, lines, log
    if not result.changes:  # noise alone marks no joint
        return move_with_torque(*about, how="same")
    how = "hangs" if load else "changed"
    # The joint that the headline names.
    joint = result.changes[0].felt.joint
    return move_with_torque(*about, torque.explained, how, load, joint)


def _place_load(result: Comparison) -> Point | None:
    """Return the centre of a load that changed, if that is the surest change."""
    for change in result.changes[:1]:
        centre, sd = change.centre
        if np.isfinite([centre, sd]).all():
            return _at_body(result.robot, change.place, centre)
    return None


def _at_body(robot: Robot, body: str, centre: Array) -> Point:
    """Return a point (3,) of the frame of a body."""
    return Point(robot.links[robot.bodies.index(body)].last, centre)


def comparison_sections(result: Comparison) -> list[Section | None]:
    """Return the sections of the page."""
    *changed, limits = result.tables()
    if changed[1:] and len(changed[0].rows) == 1:  # the answer has that row
        del changed[0]
    course = _sessions(result)
    bodies = list_loaded(result)
    frame = sentence("comparison.how", "frame", bodies=bodies) if bodies else ""
    return [
        section("comparison.changes", *changed, frame=frame) if changed else None,
        section("comparison.course", course) if course else None,
        section("comparison.limits", limits) if limits.rows else None,
    ]


def _sessions(result: Comparison) -> Picture | None:
    """Return the changes in each of several later logs."""
    changes = [c for c in result.changes if c.course][:SHOWN]
    if not changes:
        return None
    logs = _name_logs(result)[len(result.before) :]
    names = [f"{change.what}, {log}" for change in changes for log in logs]
    relative = 100 * np.array([point.relative for change in changes for point in change.course])
    values, sigma = relative.T
    return picture("sessions", draw_intervals(names, values, REACH * sigma, "change [%]"))


# Diagnosis: the answer, the gap before and after, the evidence, the residual.


def diagnosis_heading(d: Diagnosis) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    effects = ", ".join(d.base).replace("_", " ").replace("coulomb", "Coulomb")
    about = f"{d.robot.path.name} · model: {effects}"
    return "Effects that the model lacks", f"{about}{' · values fixed' if d.fixed else ''}"


def diagnosis_moving(d: Diagnosis) -> Moving | None:
    """Return the robot along unseen motion, with its residual before and after."""
    sample = (d.validation or d.samples)[0]
    gap = d.gap
    own = gap.log == 0
    torque = np.where(gap.data, gap.tau, np.nan)[own]
    residual = np.where(gap.data[:, :, None], gap.residual, np.nan)[own]
    before = residual[..., 0]
    about = d.robot, sample.motion, gap.t[0], torque
    if not d.included:
        lines = torque_lines(torque, torque - before)
        return move_with_torque(*about, lines, sample.name, before)
    lines = {"before": before, "after": residual[..., -1]}
    joint = d.robot.joints[d.curves[0].joint] if d.curves else ""
    return move_with_torque(*about, lines, sample.name, before, "explained", joint=joint)


def diagnosis_below(d: Diagnosis) -> Picture | None:
    """Return the learned curve of the first effect."""
    return next(_curves(d), None)


def diagnosis_sections(d: Diagnosis) -> list[Section | None]:
    """Return the sections of the page."""
    bending = None if d.bending is None or not d.bending.joints else _section_bending(d.bending)
    title = sentence("analysis.parameters", "title")
    judged = d.judged
    own = [] if judged is None else [section_values(judged, title), section_parameters(judged)]
    return [
        *own[:1],
        section_effects(d),
        _section_gap(d),
        None if d.forward is None else section_forward(d.forward, d.robot.joints),
        bending,
        *own[1:],
        _section_where(d),
        *_sections_method(d),
    ]


# Named effects, their learned curves, and the motion of the model with them.


#: Curves and joints that are drawn.
SHOWN = 6


def section_effects(d: Diagnosis) -> Section | None:
    """Return the named effects with their values, the refuted effects, and the possible ones.

    The first curve is on the first screen.
    """
    others = [*_curves(d)][1:]
    curves = gallery("curves", others) if others else None
    refuted = None
    if d.refuted:
        refuted = make_table("refuted", map(_odds_row, d.refuted), verified=d.verified_on)
    possible = None
    if d.possible:
        table = make_table("possible", map(_possible_row, d.possible))
        possible = Fold(sentence("diagnosis.possible"), (table,))
    blocks = (*d.tables()[d.judged is not None : -1], curves, refuted, possible)
    use = sentence("diagnosis.use", "kept" if moves_worse(d.moved) else "fitted")
    return section("diagnosis.effects", *blocks, use=use) if any(blocks) else None


def _curves(d: Diagnosis) -> Iterator[Picture]:
    """Yield the learned curves of some effects, against the data.

    The first effect comes first, then the largest torque. Curves that explain less than half of the
    variation of their points are left out.
    """
    seen = [c for c in d.curves if np.var(c.data - c.learned) <= 0.5 * np.var(c.data)]
    first = seen[:1] or d.curves[:1]
    others = sorted(seen[1:], key=_largest_torque, reverse=True)
    curves = [*first, *others]
    for c in curves[:SHOWN]:
        title = f"{capital(shorten_title(c.title))}, {d.robot.joints[c.joint]}"
        figure = draw_curve(
            c.x,
            c.learned,
            c.spread,
            c.data,
            title,
            _labels(d, c),
        )
        yield picture("curve", figure, title=title)


def _largest_torque(c: Curve) -> float:
    """Return the largest torque of a learned curve."""
    return float(np.abs(c.learned).max())


def _labels(d: Diagnosis, c: Curve) -> tuple[str, str]:
    """Return the labels of the axes of a curve."""
    other = "" if c.of == c.joint else f" of {d.robot.joints[c.of]}"
    position = d.robot.position_units[c.of]
    units = {"velocity": f"{position}/s", "position": position, "load": d.robot.torque_units[c.of]}
    over = "time of the session" if c.against == "session" else c.against
    unit = d.robot.torque_units[c.joint]
    return f"{over}{other} [{units.get(c.against, 's')}]", f"{name_torque(unit)} [{unit}]"


def _section_gap(d: Diagnosis) -> Section:
    t = d.gap.t[0]
    part = np.flatnonzero(d.gap.log == 0)[t <= t[0] + STRETCH]
    residual = d.gap.residual[part]
    lines = {"before": residual[..., 0], "after": residual[..., -1]}
    caption = sentence("diagnosis.traces", seconds=f"{STRETCH:g}")
    joint = d.curves[0].joint if d.curves else 0
    names = d.robot.joints, d.robot.torque_units
    shown = traces(t[: len(part)], *names, lines, "residual", caption, joint)
    return section(
        "diagnosis.gap",
        d.tables()[-1],
        Fold("The residual of every joint over time, to zoom", (shown,)),
    )


def section_forward(gap: ForwardGap, joints: Strings) -> Section:
    """Return the section on simulated motion before and after the named effects."""
    horizon = gap.horizon
    if not gap.measured:
        return section("diagnosis.motion", f"Not done: {gap.note}", horizon=horizon)
    figure = draw_forward(gap.t, gap.before.mean(2), gap.after.mean(2))
    before = gap.before[:, -1].mean(0)
    after = gap.after[:, -1].mean(0)
    return section(
        "diagnosis.motion",
        picture("forward", figure, stretches=len(gap.before)),
        make_table("forward", zip(joints, before, after, strict=True)),
        horizon=horizon,
    )


def _section_bending(found: Bending) -> Section:
    """Return the frequency response of each joint that bends."""
    pictures = []
    for x in found.joints:
        r = x.response
        figure = draw_response(r.frequency, r.measured, r.modelled, x.resonance)
        pictures.append(picture("response", figure, title=x.joint))
    return section("diagnosis.response", gallery("responses", pictures), band=found.band)


def _section_where(d: Diagnosis) -> Section:
    causes = max((x.explained for x in d.discrepancies), key=len)  # none where torque is no data
    units = dict(zip(d.robot.joints, d.robot.torque_units, strict=True))
    rows = [
        (
            x.joint,
            unit_cell(x.rms, units[x.joint]),
            x.share,
            *(x.explained.get(k, np.nan) for k in causes),
        )
        for x in d.discrepancies
    ]
    explained = [Column(cause, rough_percent) for cause in causes]
    return section("diagnosis.where", make_table("where", rows, more=explained))


def _possible_row(x: Odds) -> dict[str, Any]:
    """Return the odds of an effect without a name as one row of a table, and why it has none."""
    part = "harmful" if np.isnan(x.needed) else "weak" if x.unseen < x.needed else "alike"
    return {**_odds_row(x), "why": sentence("diagnosis.possible", part, **vars(x))}


def _odds_row(x: Odds) -> dict[str, Any]:
    """Return the log odds of a family at a place as one row of a table."""
    return {**vars(x), "title": title_of(x.name)}


def _sections_method(d: Diagnosis) -> tuple[Section, ...]:
    """Return the evidence of all candidates, the refused candidates, and the method."""
    order = sorted(d.evidence, key=lambda x: -x.before)
    table = make_table("evidence", map(_odds_row, order[:SHOWN_FIRST]))
    why: dict[tuple[str, str], list[str]] = {}
    for r in d.refusals:
        why.setdefault((title_of(r.family), r.reason), []).append(r.place)
    refused = tuple(
        Term(" in ".join(filter(None, (title, join(list(filter(None, places)), NAMED)))), reason)
        for (title, reason), places in why.items()
    )
    reasons = Terms(refused) if refused else "Every family was asked."
    return (
        section("diagnosis.evidence", table),
        section("diagnosis.refusals", reasons),
        section("diagnosis.method", sentence("diagnosis.roles", verified=d.verified_on)),
    )


# Excitation: the motion to measure, and its information.


def excitation_heading(result: Excitation) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    return "Excitation report", (
        f"{sentence('excitation.title', result.criterion.name)} · "
        f"{format_number(result.trajectory.period)} s, "
        f"{format_count(result.trajectory.samples, 'sample')}"
    )


def excitation_moving(result: Excitation) -> Moving | None:
    """Return the robot along the motion."""
    t, *motion = result.motion
    poses = complete_motion(result.robot, t, *motion).q
    caption = sentence("excitation.moving", seconds=t[-1] - t[0])
    return move_skeletons(result.robot, t, {"motion": ("blue", poses)}, lambda rows: [], caption)


def excitation_notes(result: Excitation) -> list[Note]:
    """Return the cautions and hints of the answer."""
    return [*result.cautions(), *map(hint_note, result.hints)]


def excitation_sections(result: Excitation) -> list[Section]:
    """Return the sections of the page: the motion, its information, and the method."""
    logs = ", ".join(shorten_paths(result.logs))
    measured = sentence("excitation.measured", logs=logs) if logs else ""
    text = words(
        "excitation.how",
        harmonics=result.trajectory.harmonics,
        motions=result.evaluations,
        seed=result.seed,
        effects=", ".join(result.effects),
        measured=measured,
    )
    return [
        section("excitation.ranges", *result.tables()),
        section("excitation.motion", *_motion(result)),
        section("excitation.method", Prose(tuple(text.values()))),
    ]


def _motion(result: Excitation) -> list[Traces]:
    """Return every joint along the motion, and the limits that it keeps."""
    t, *parts = result.motion
    limits = result.limits
    highest = (limits.high, limits.speed, limits.acceleration)
    lowest = (limits.low, -limits.speed, -limits.acceleration)
    names = (("position", ""), ("velocity", "/s"), ("acceleration", "/s²"))
    shown = []
    for (name, per), x, low, high in zip(names, parts, lowest, highest, strict=True):
        own = [f"{unit}{per}" for unit in result.robot.position_units]
        bounds = np.stack([low, high], 1)
        shown.append(motion_traces(name, t, x, limits.joints, own, bounds))
    return shown


# Inspection: content and problems of logs, and the robot.


def inspection_heading(result: Inspection) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    about = [result.robot.path.name, count_joints(result.robot)]
    if result.records:
        about += [format_count(len(result.records), "log")]
    kind = "What is in the logs" if result.records else "What the robot file says"
    return kind, " · ".join(about)


def inspection_moving(result: Inspection) -> Moving | None:
    """Return the robot along the log with the largest torque, of those that can be read.

    Without logs each joint of a tree moves in turn.
    """
    if not result.records:
        return _move_in_turn(result.robot)
    each = [r for r in result.records if np.isfinite(r.q).all() and np.isfinite(r.tau).all()]
    if not each:
        return None
    first = max(each, key=lambda record: np.abs(record.tau).max(initial=0.0))
    still = np.zeros_like(first.q)
    t = first.t - first.clock["start"]
    motion = complete_motion(result.robot, t, first.q, still, still)
    lines = {"from commands" if "kp" in first.joints else "measured": first.tau}
    return move_with_torque(
        result.robot,
        motion,
        t,
        first.tau,
        lines,
        first.name,
    )


def _move_in_turn(robot: Robot) -> Moving | None:
    """Return each joint of a tree on a base through its range, at most 1 rad or m from home."""
    if robot.closed or robot.base is not None:
        return None
    home = robot.actuated_positions(robot.home[None])
    joints = np.arange(home.shape[1])
    t = np.linspace(0.0, 2.0 * len(joints), 50 * len(joints), endpoint=False)
    phase = np.sin(np.pi * t)[:, None] * (t[:, None] // 2 == joints)
    reach = np.fmax(np.fmin(np.abs(robot.limits - home.T), 1.0), 0.0)
    q = home + phase * np.where(phase < 0, *reach.T)
    poses = {"motion": ("grey", complete_motion(robot, t, q, 0 * q, 0 * q).q)}
    return move_skeletons(robot, t, poses, lambda rows: [], sentence("inspection.moving"))


def inspection_sections(result: Inspection) -> list[Section]:
    """Return the sections of the page: joints, logs over time, then the robot on demand."""
    own = _robot(result)
    if not result.records:
        return own
    names = [record.name for record in result.records]
    clock, motion, *each = result.tables()
    single = [Fold(sentence("inspection.each"), (table,)) for table in each]
    first, *others = (_recorded(result, record) for record in result.records)
    folds = (Fold(f"Position and torque of {n}", x) for n, x in zip(names[1:], others, strict=True))
    preparations = map(_preparation, result.records)
    return [
        section("inspection.motion", motion, *single),
        section("inspection.traces", *first, *folds),
        section("inspection.clock", clock, *preparations),
        *own,
    ]


def _recorded(result: Inspection, record: Record) -> tuple[Traces, ...]:
    """Return position and torque of every joint of a log over time."""
    robot = result.robot
    t = record.t - record.clock["start"]
    # Nobody measures position and force of a base that floats.
    (at,) = np.nonzero(record.joints["joint"].isin(robot.motor_joints))
    if not (len(at) and len(t)):
        return ()
    words = record.joints[["joint", "unit", "torque_unit"]].iloc[at]
    names, units, torque_units = words.to_numpy().T.tolist()
    positions = motion_traces("position", t, record.q[:, at], names, units, robot.limits[at])
    torques = motion_traces("torque", t, record.tau[:, at], names, torque_units, None)
    return positions, torques


def _preparation(record: Record) -> Prose | None:
    """Return the reading and preparation of a log, if they differ from the default."""
    told = [f"{capital(text)}." for text in record.notes]
    if record.clock["parts"] > 1:
        told.append(sentence("inspection.windows", parts=record.clock["parts"]))
    return Prose((f"{record.name}: {' '.join(told)}",)) if told else None


def _robot(result: Inspection) -> list[Section]:
    """Return joints, columns and parameters of the robot file, and the open questions of it."""
    from .answers.inspect import joint_table  # noqa: PLC0415

    robot = result.robot
    joints = replace(joint_table(result), caption="")
    motors = ", ".join(result.motors)
    beside = sentence("inspection.motors", motors=motors) if motors else None
    base = result.base
    groups = zip(base.names, base.units, base.labels, strict=True)
    effects = ", ".join(result.effects).replace("_", " ").replace("coulomb", "Coulomb")
    parameters = section(
        "inspection.parameters",
        phrase("needs", "naming"),
        make_table("grouped", groups),
        count=base.rank,
        standard=len(base.parameters),
        effects=effects,
    )
    found = [
        section("inspection.joints", joints),
        section("inspection.columns", ", ".join(result.columns), beside),
        parameters,
    ]
    if result.needs:
        rows = [(need.text, need.line.replace("\n", "  ") or NONE) for need in result.needs]
        name = robot.path.with_suffix(".toml").name
        found.append(
            section(
                "inspection.sidecar",
                make_table("needs", rows),
                name=name,
            )
        )
    return found


# Load: mass, centre and inertia of a body in the gripper.


def payload_heading(result: Load) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    loaded, empty = (join(shorten_paths(x), 3) for x in (result.logs, result.without))
    logs = f"{loaded} against {empty}" if empty else loaded
    return "Payload report", f"{result.robot.path.name} · {_name_model(result.model)} · {logs}"


def payload_moving(result: Load) -> Moving | None:
    """Return the robot over the torque of its load at a joint, with the load if it is sure."""
    if result.gains:  # columns may be in any unit
        return None
    torque = result.estimate.torque
    about = result.robot, result.motion, torque.t
    log = shorten_paths(result.logs)[0]
    if not all(q.told for q in result.quantities[:4]):
        lines = {"measured": torque.measured, "explained": torque.explained}
        return move_with_torque(*about, torque.whole, lines, log, torque.explained, "changed")
    load = _at_body(result.robot, result.body, result.parameters[6:9] / result.parameters[9])
    lines = {"measured": torque.measured, "computed": torque.explained}
    return move_with_torque(*about, torque.explained, lines, log, how="load", load=load)


def payload_below(result: Load) -> Picture | None:
    """Return the gains that a known load determines."""
    gains = [g for g in result.gains if g.told]
    if not gains:
        return None
    values, halves = np.array([(g.value, g.half) for g in gains]).T
    label = "one unit of the torque column [N·m or N]"
    return picture("gains", draw_intervals([g.name for g in gains], values, halves, label, 1.0))


def payload_sections(result: Load) -> list[Section | None]:
    """Return the sections of the page: gains, or quantities and how."""
    if result.gains:
        return [section("payload.gains", *result.tables())]
    return [
        section("payload.quantities", result.tables()[0], body=result.body),
        section("payload.method", sentence("payload.how", "plain", body=result.body)),
    ]


# TorquePrediction: measured and predicted torque along logs.


def prediction_heading(result: TorquePrediction) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    model = _name_model(result.fit.submodel.name)
    return "Predicted torque", f"{result.robot.path.name} · {model}"


def _name_model(name: str) -> str:
    """Return the name of a model for the head of a page."""
    return f"model {name}" if name.startswith("without ") else name


def prediction_moving(result: TorquePrediction) -> Moving | None:
    """Return the robot along the first log, with its torque."""
    rows = result.log == 0
    measured = result.tau[rows]
    predicted = result.predicted[rows]
    along = (result.robot, result.motion, result.t[rows])
    name = shorten_paths(result.logs)[0]
    if not result.measured[0]:
        return move_with_torque(*along, predicted, {"predicted": predicted}, name)
    lines = torque_lines(measured, predicted)
    return move_with_torque(*along, measured, lines, name, lines["residual"])


def prediction_sections(result: TorquePrediction) -> list[Section]:
    """Return measured and predicted torque along each log, and the errors of joints."""
    blocks: list[Block] = []
    for log, name in enumerate(shorten_paths(result.logs)):
        rows = result.log == log
        robot = result.robot
        along = (result.t[rows], result.tau[rows], result.predicted[rows])
        joints = (robot.joints, robot.torque_units)
        blocks.append(torque_traces(*along, *joints, name, result.low[rows]))
    what = name_torque(" ".join(result.robot.torque_units))
    return [
        section("prediction.joints", result.tables()[0]),
        section("prediction.torque", *blocks, what=what),
    ]
