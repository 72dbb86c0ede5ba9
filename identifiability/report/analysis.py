"""The reports on an `Analysis` and on a `Ladder`: the answer first, then its evidence."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.effects import title_of
from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.prediction import Prediction, loaded_joints
from identifiability.estimation.verdict import Class
from identifiability.foundation.answers import Cell, Note, Table
from identifiability.foundation.findings import of_key
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName
from identifiability.foundation.rounding import REACH, format_count, format_number, join
from identifiability.logs.prepare.dataset import Dataset
from identifiability.physical.cad_prior import mass_rows, total_mass
from identifiability.posterior.rules import RULES as POSTERIOR_RULES
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.predict import Fit

from . import plot
from .answers.analyze import (
    error_tables,
    file_table,
    label_note,
    model_title,
    parameter_table,
    state_nearest,
)
from .answers.common import capital, join_sentences, note, sentence, words
from .answers.prune import sizes_as_good
from .answers.tables import make_table
from .answers.values_table import joint_values, offset_table

if TYPE_CHECKING:
    from identifiability.workflows.analyze.result import Laddered, ModelResult
    from identifiability.workflows.prune.result import Ladder

from .blocks import (
    GLOSSARY,
    Fold,
    Moving,
    Notes,
    Picture,
    Prose,
    Section,
    Term,
    Terms,
    count_words,
    gallery,
    picture,
    section,
    torque_lines,
    torque_traces,
)
from .figures import name_torque
from .rollouts import rollout_moving, section_positions
from .skeleton import move_with_torque


def analysis_heading(analysis: Analysis) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    model = "" if analysis.nothing else f"{model_title(analysis.chosen).removeprefix('the ')} · "
    about = f"{analysis.robot.path.name} · {model}{_name_added(analysis)}{count_logs(analysis)}"
    return "Identifiability report", about


def _name_added(result: Laddered[Any]) -> str:
    """Return the effects that the model got because the logs show them."""
    added = of_key(result.remarks, "completed")
    return f"with {join(added[0].numbers['what'])} · " if added else ""


def count_logs(result: Laddered[Any]) -> str:
    """Return the number of fitted and of held-out logs."""
    fitted = f"{format_count(len(result.samples), 'log')} fitted"
    held = f", {len(result.validation)} held out" if result.validation else ""
    return f"{fitted}{held}".replace(" ", "\xa0")


def drawn_torque(out: Prediction) -> tuple[Array, Array]:
    """Return measured and predicted torque of the first log, (N, n), NaN where it is no data."""
    both = out.tau, out.predicted[:, :, 0]
    measured, predicted = (np.where(out.data, x, np.nan)[: len(out.t[0])] for x in both)
    return measured, predicted


def analysis_moving(analysis: Analysis) -> Moving | None:
    """Return the robot along unseen motion, with measured and predicted torque or positions."""
    moved = analysis.moved
    if moved is not None and moved.follows:
        commands = tuple(log.q if log.q_ref is None else log.q_ref for log in moved.logs)
        ahead = replace(moved.runs[0], name="command", q=commands, errors=moved.from_commands)
        return rollout_moving(replace(moved, runs=(ahead, moved.runs[1])))
    sample = (analysis.validation or analysis.samples)[0]
    out = analysis.held_out
    lines = torque_lines(*drawn_torque(out))
    about = analysis.robot, sample.motion, out.t[0], lines["measured"]
    return move_with_torque(*about, lines, sample.name, lines["residual"])


def analysis_sections(analysis: Analysis) -> list[Section | None]:
    """Return the sections of the page."""
    title = sentence("analysis.parameters", "title")
    return [
        section_values(analysis, title),
        _positions(analysis),
        section_prediction(analysis),
        section_parameters(analysis),
        section_ladder(analysis),
        None if analysis.nothing else section_correlated(analysis.fit),
        section_physics(analysis),
        section_profiles(analysis) if analysis.profiles else None,
        None if analysis.belief is None else section_posterior(analysis),
        _how(analysis),
    ]


def _positions(analysis: Analysis) -> Section | None:
    """Return measured and simulated positions, if the answers are about these."""
    moved = analysis.moved
    if moved is None or not moved.follows:
        return None
    # The robot file as it came errs too much to show the others beside it.
    return section_positions(replace(moved, runs=moved.runs[1:]))


# Parameters, and the models side by side.


def section_values(result: Laddered[Any], parameters: str, errors: str = "") -> Section | None:
    """Return mass, friction and rotor of each joint; `parameters` is the title of all of them.

    `errors` says what standard errors contain.
    """
    values = joint_values(result, parameters)
    if result.nothing or values is None:
        return None
    cells = [cell for row in values.rows for cell in row]
    opened = sentence("values", "opened") if any(cell.more for cell in cells) else ""
    other = any("≠" in cell.note for cell in cells)
    differs = sentence("values", "excluded") if other else ""
    told = {"opened": opened, "differs": differs, "errors": errors}
    return section("analysis.values", values, offset_table(result), **told)


INERTIAL_KEY = (
    "m, mx … mz, Ixx … Izz",
    "mass [kg], mass times centre of mass [kg·m] and inertia [kg·m²] of a body, in the frame of "
    "the joint that carries it and about its origin",
)


def section_parameters(analysis: Analysis) -> Section:
    """Return the parameters of the selected model, the identifiable ones first."""
    chosen = analysis.chosen
    figure = picture("precision", plot.precision(analysis), model=chosen.name)
    table = order_verdicts(chosen)
    return section(
        "analysis.parameters",
        table,
        Fold("How well each of them is known", (figure,)),
        Fold("Which numbers of the robot file may I believe?", (file_table(analysis),)),
        _name_key(analysis),
        size=len(chosen.submodel),
        counts=count_words(table),
    )


def order_verdicts(result: ModelResult) -> Table:
    """Return the parameters of a model: the identifiable ones of bodies that decide most first.

    Friction and rotors are among the values of joints above.
    """
    table = parameter_table(result)

    def rank(at: int) -> float:
        v = result.verdicts[at]
        known = v.verdict is Class.IDENTIFIABLE and v.name.rpartition(".")[2] in INERTIAL_KINDS
        return -v.share if known else 0.0

    order = sorted(range(len(table.rows)), key=rank)
    rows = tuple(table.rows[k] for k in order)
    return replace(table, rows=rows)


def _name_key(analysis: Analysis) -> Fold:
    """Return an explanation of the names of parameters."""
    terms = [Term("NAME.KIND", sentence("analysis.key")), Term(*INERTIAL_KEY)]
    for effect in analysis.structure.model.effects:
        kinds = dict.fromkeys(p.kind for p in effect.parameters(analysis.robot))
        if effect.name != "rigid_body" and kinds:
            terms.append(
                Term(
                    ", ".join(kinds),
                    title_of(effect.name),
                    formula=effect.equation,
                )
            )
    short = analysis.robot.symbols.items()
    named = [f"{symbol} is {name}" for name, symbol in short if symbol != name]
    if named:
        terms.append(Term("short forms", f"{'; '.join(named)}."))
    return Fold("What the names mean", (Terms(tuple(terms)),))


def section_ladder(analysis: Analysis) -> Section:
    """Return the ladder of models: why the selected one."""
    chosen = analysis.chosen
    count = len(analysis.models)
    part = "smallest" if count > 1 else "only"
    why = capital(sentence("analysis.why", part, title=model_title(chosen), count=count))
    kind = analysis.validation_kind
    return section("analysis.models", analysis.tables()[0], why=why, kind=kind)


# Torque: measured and predicted, its contributions, and the residual.


def section_prediction(analysis: Analysis) -> Section:
    """Return measured and predicted torque of every joint along the first unseen log."""
    out = analysis.held_out
    robot = analysis.robot
    name = (analysis.validation or analysis.samples)[0].name
    what = name_torque(" ".join(robot.torque_units))
    loaded = loaded_joints(out.rms)
    measured, predicted = (x[:, loaded] for x in drawn_torque(out))
    traces = torque_traces(
        out.t[0],
        measured,
        predicted,
        [robot.joints[k] for k in loaded],
        [robot.torque_units[k] for k in loaded],
        name,
    )
    filtered = "" if np.array_equal(out.tau, out.raw) else ", low-passed as in the fit"
    return section(
        "analysis.prediction",
        traces,
        Fold(sentence("analysis.errors"), error_tables(analysis)),
        log=name,
        filtered=filtered,
        what=what,
        What=what.capitalize(),
        kind="not fitted" if analysis.validation else "left-out stretches",
        windows=_tell_windows(analysis),
    )


def _tell_windows(analysis: Analysis) -> str:
    """Return the number of samples behind errors, if it is not all of them."""
    for found in (analysis.held_out, analysis.fitted):
        if len(found.log) < found.total:
            return sentence("analysis.windows", shown=len(found.log), total=found.total)
    return ""


#: Parameters are correlated where the absolute correlation of their estimates is above this.
CONFUSED = 0.7


def section_correlated(fit: Fit) -> Section:
    """Return the parameters whose estimates hang together, in words."""
    rho = np.triu(np.nan_to_num(fit.correlation_frame().to_numpy()), 1)
    pairs = np.argwhere(np.abs(rho) > CONFUSED)
    if not len(pairs):
        return section("analysis.correlated", text=sentence("analysis.apart"))
    ranked = sorted(pairs.tolist(), key=lambda at: -abs(rho[tuple(at)]))
    each = [
        f"{fit.names[i]} and {fit.names[j]} ({format_number(float(rho[i, j]), 2)})"
        for i, j in ranked[:5]
    ]
    text = sentence("analysis.together", count=len(np.unique(pairs)), pairs=each)
    return section("analysis.correlated", text=text)


# Whether a real robot can have the values.


def section_physics(analysis: Analysis) -> Section:
    """Return the certificate, the active constraints, and the masses of the bodies."""
    physical = analysis.chosen.physical
    assert physical is not None
    active = () if physical.nearest is None else physical.nearest.active
    certificate = join_sentences(
        state_nearest(analysis.chosen), physical.sentence, analysis.mass_warning
    )
    held = ""
    if active or physical.feasible:
        held = sentence("analysis.held", "some" if active else "none", names=active)
    masses = mass_table(analysis.robot, physical.parameters())
    return section("analysis.physics", masses, certificate=f"{certificate} {held}".rstrip())


def section_profiles(analysis: Analysis) -> Section:
    """Return the curves of the profiled numbers."""
    names = [curve.number.name for curve in analysis.profiles]
    curves = [picture("profile", plot.profile(analysis, name), name=name) for name in names]
    return section("analysis.profiles", gallery("profiles", curves), limit=REACH**2)


def mass_table(robot: Robot, parameters: NumberByName) -> Table | None:
    """Return the identified masses of bodies and those of the robot file; nothing without masses.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name.
    """
    rows = [tuple(row.values()) for row in mass_rows(robot, parameters)]
    whole = ("all", total_mass(robot, parameters), total_mass(robot, robot.nominal))
    return make_table("masses", [*rows, whole]) if rows else None


# How it was done: motion, thresholds, words, versions.


def _how(analysis: Analysis) -> Section:
    """Return the preparation of logs, a glossary, versions, the seed and hashes of the inputs."""
    robot = analysis.robot
    logs = [("fitted", s) for s in analysis.samples]
    logs += [("held out", s) for s in analysis.validation]
    seen = analysis.information.samples
    kept = sum(log.survey.kept for log in analysis.samples)
    rows = [(k, v) for k, v in analysis.provenance.items() if not k.startswith("sha256")]
    rows.append((f"robot {robot.path.name}", f"sha256 {robot.sha256}"))
    rows += [(f"{use} {s.name}", f"sha256 {s.sha256}") for use, s in logs]
    thinned = sentence("analysis.windows", "thinned", rows=kept) if seen < kept else ""
    prepared = make_table("prepared", [_log_row(use, s) for use, s in logs])
    thresholds = Fold(sentence("analysis.thresholds"), (Terms(GLOSSARY),))
    provenance = Fold(sentence("analysis.provenance"), (make_table("provenance", rows),))
    estimator = sentence("estimators", analysis.chosen.estimate.estimator.name)
    return section(
        "analysis.motion",
        prepared,
        thresholds,
        provenance,
        seen=seen,
        thinned=thinned,
        estimator=estimator,
        out=len(analysis.held_out.log),
        kind=analysis.validation_kind,
    )


def _log_row(use: str, log: Dataset) -> tuple[str | int, ...]:
    """Return a prepared log as one row of a table: name, use, samples, span and preparation."""
    survey = log.survey
    span = f"{survey.start:.4g} … {survey.stop:.4g}" if survey.kept else ""
    notes = "; ".join(log.notes) + "." if log.notes else ""
    return log.name, use, log.outputs, span, notes


# Posterior: the parameters of the model to use by every method.


def section_posterior(analysis: Analysis) -> Section:
    """Return the parameters of the selected model by every method, side by side."""
    notes = posterior_notes(analysis)
    remarks = Notes(notes) if notes else None
    title = model_title(analysis.chosen)
    return section("analysis.posterior", remarks, posterior_table(analysis), title=title)


def posterior_notes(analysis: Analysis) -> tuple[Note, ...]:
    """Return why the posterior, or an interval of it, is not shown, if one is not."""
    belief = analysis.belief
    assert belief is not None
    summary = belief.physical
    if summary is None:
        why = belief.note.rstrip(".")
        return (note("no-posterior", why=capital(why)),)
    if not summary.convergence.trustworthy:
        return (note("doubtful", why=" ".join(summary.convergence.reasons)),)
    if summary.stated.all():
        return ()
    names = np.array(analysis.chosen.submodel.columns)[~summary.stated].tolist()
    share = f"{len(names)} of {len(summary.stated)}"
    limit = 100 * POSTERIOR_RULES.prior_sensitivity
    return (note("prior-sensitive", share=share, names=names, limit=limit),)


def posterior_table(analysis: Analysis) -> Table | None:
    """Return the posterior and the estimate of each parameter; none where it may not be shown.

    An interval is left out where the prior's density at an edge decides it.
    """
    summary = None if analysis.belief is None else analysis.belief.physical
    if summary is None or not summary.convergence.trustworthy:
        return None
    ends = np.where(
        summary.stated[:, None],
        summary.interval,
        np.nan,
    )
    numbers = zip(summary.mean, summary.sd, *ends.T, strict=True)
    rows = [
        (Cell(v.name, note=label_note(v.label)), v.value, *each, v.unit)
        for v, each in zip(analysis.chosen.verdicts, numbers, strict=True)
    ]
    return make_table("posterior", rows)


# Ladder: the model worth using first, then every move that led to it.


def pruning_heading(ladder: Ladder) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    about = f"{ladder.robot.path.name} · {_name_added(ladder)}{count_logs(ladder)}"
    return "Pruning report", about


def pruning_below(ladder: Ladder) -> Picture:
    """Return the error of every model of the path over its size."""
    likely = sentence("pruning.use", "shaded") if sizes_as_good(ladder) else ""
    known = np.isfinite(ladder.chosen.unseen_by(1))
    exported = sentence("pruning.use", "exported") if known else ""
    return picture("ladder", plot.reduction_path(ladder), likely=likely, exported=exported)


def pruning_sections(ladder: Ladder) -> list[Section | None]:
    """Return the sections of the page."""
    settings = {key: ladder.settings[key] for key in ("method", "seed")}
    text = words("pruning.how", effects=", ".join(ladder.effects), **settings)
    title = sentence("pruning.survivors", "title")
    why = sentence("pruning.why", nats=LEVELS.nats, rise=LEVELS.rise)
    return [
        section_values(ladder, title, sentence("values", "omitted")),
        section("pruning.ladder", ladder.tables()[0], why=why),
        section_survivors(ladder),
        None if ladder.nothing else section_correlated(ladder.fit),
        section("pruning.method", Prose(tuple(text.values()))),
    ]


def section_survivors(ladder: Ladder) -> Section:
    """Return the parameters of the model to use."""
    table = order_verdicts(ladder.chosen)
    return section(
        "pruning.survivors",
        table,
        Fold(sentence("analysis.errors"), ladder.tables()[1:]),
        size=len(ladder.chosen),
        counts=count_words(table),
    )
