"""Measured against predicted torque on unseen motion, and what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.noise.autocorrelation import autocorrelation
from identifiability.foundation.names import Array
from identifiability.report.blocks import Block, Fold, Gallery, Section, Trace, Traces
from identifiability.report.drawing import peak_rows
from identifiability.report.figures.motion import (
    choose_stretch,
    draw_autocorrelation,
    draw_histogram,
    draw_residual_velocity,
    draw_torque,
)
from identifiability.report.numbers import digits, error_text, time_text
from identifiability.report.sections.facts import (
    model_title,
    torque_units,
    unseen_samples,
    velocity_units,
)
from identifiability.report.tables import Column, Table
from identifiability.report.words import columns, gallery, picture, section, sentence
from identifiability.workflows.analyze import Analysis

#: Joints that are shown at once; those beyond are folded.
SHOWN = 6

#: Points of all torque lines, and of all scatter plots, of a page.
LINE_POINTS, SCATTER_POINTS = 18_000, 5_000

#: Lags of the autocorrelation that are shown: least, most, and per autocorrelation time.
LAGS = (40, 400, 12.0)


def section_prediction(analysis: Analysis) -> Section:
    """Return measured and predicted torque of every joint along a stretch of unseen motion."""
    samples = unseen_samples(analysis)[0]
    times = analysis.held_out.t[0]
    first = analysis.held_out.series[: len(times)] == analysis.held_out.series[:1]
    part = choose_stretch(times[first])
    shown = times[part]
    return section(
        "analysis.prediction",
        torque_traces(analysis),
        Fold("Each joint as a picture", torque_pictures(analysis, part)),
        joint_table(analysis),
        log_table(analysis) if len(analysis.samples) + len(analysis.validation) > 1 else None,
        log=samples.name,
        span=f", t = {shown[0]:.3g} … {shown[-1]:.3g} s," if len(shown) > 1 else "",
        model=model_title(analysis.chosen),
        kind="a log that" if analysis.validation else "stretches of a log that",
        windows=_tell_windows(analysis),
    )


def _tell_windows(analysis: Analysis) -> str:
    """Return how many samples errors are of, where they are not of all."""
    for found in (analysis.held_out, analysis.fitted):
        if not found.whole:
            shown, total = f"{found.samples:,}", f"{found.total:,}"
            return sentence("analysis.windows", shown=shown, total=total)
    return ""


def torque_traces(analysis: Analysis) -> Traces:
    """Return the torque of each joint along the whole first unseen log, to zoom and read off."""
    out, m = analysis.held_out, analysis.selected
    t, whole = out.t[0], out.to_draw(m)
    most = max(300, LINE_POINTS // (2 * len(analysis.robot.joints)))
    groups = []
    for k, (joint, unit) in enumerate(
        zip(analysis.robot.joints, torque_units(analysis.robot), strict=True)
    ):
        measured, predicted = (x[: len(t), k] for x in whole)
        rows = peak_rows((measured, predicted, measured - predicted), most)
        lines = {"measured": measured, "predicted": predicted, "left over": measured - predicted}
        groups.append(Trace.of(joint, unit, t[rows], {n: y[rows] for n, y in lines.items()}))
    return Traces(tuple(groups), sentence("analysis.traces", log=unseen_samples(analysis)[0].name))


def torque_pictures(analysis: Analysis, part: slice) -> tuple[Block, ...]:
    """Return one picture for each joint over a part of the first unseen log."""
    joints, units = analysis.robot.joints, torque_units(analysis.robot)
    out = analysis.held_out
    t = out.t[0][part]
    tau, predicted = (x[: len(out.t[0])][part] for x in out.to_draw(analysis.selected))
    errors = out.joint_error()[:, analysis.selected]
    most = int(np.clip(LINE_POINTS // (3 * len(joints)), 200, 1500))
    width = {1: 720, 2: 500}.get(len(joints), 400)
    pictures = []
    for k, joint in enumerate(joints):
        title = f"{joint}, error {error_text(errors[k])}"
        figure = draw_torque(t, tau[:, k], predicted[:, k], title, units[k], most, width)
        pictures.append(picture("torque", figure, joint=joint))
    return fold_gallery(Gallery(tuple(pictures)))


def joint_table(analysis: Analysis) -> Table:
    """Return the errors of each joint by itself."""
    fitted, out, m = analysis.fitted, analysis.held_out, analysis.selected
    own = columns(
        "joints",
        Column("joint"),
        Column("measured, rms", digits(3)),
        Column("unit"),
        Column("error, fitted", error_text),
        Column("error, unseen", error_text),
        Column("rms error, unseen", digits(3)),
        Column("of raw torque, unseen", error_text),
        Column("autocorrelation time [samples]", time_text),
    )
    rows = zip(
        analysis.robot.joints,
        out.rms,
        torque_units(analysis.robot),
        fitted.joint_error()[:, m],
        out.joint_error()[:, m],
        out.joint_rms()[:, m],
        out.joint_error(raw=True)[:, m],
        analysis.chosen.autocorrelation_time,
        strict=True,
    )
    return Table.of("Each joint by itself, relative to how much its own torque varies", own, rows)


def log_table(analysis: Analysis) -> Table:
    """Return the errors of the selected model on each log, as fitted and as held out."""
    errors = analysis.error_frame()
    own = (
        Column("log"),
        Column("samples", "number"),
        Column("error, fitted", error_text),
        Column("error, unseen", error_text),
    )
    logs = errors[errors["of"] == "log"][["name", "error", "error_validation"]]
    samples = (*analysis.samples, *analysis.validation)
    pairs = zip(samples, logs.itertuples(index=False), strict=True)
    return Table.of("Each log by itself", own, [(n, s.outputs, a, b) for s, (n, a, b) in pairs])


def section_residuals(analysis: Analysis) -> Section:
    """Return distribution, memory and place of the residual."""
    return section("analysis.residuals", noise_pictures(analysis), *velocity_pictures(analysis))


def noise_pictures(analysis: Analysis) -> Gallery:
    """Return the distribution and the autocorrelation of the residual on the fitted motion."""
    fitted = analysis.fitted
    residual = fitted.residual[:, :, analysis.selected]
    rows = fitted.data.sum(0)
    centred = residual - residual.sum(0) / np.maximum(rows, 1)
    spread = np.sqrt((centred**2 * fitted.data).sum(0) / np.maximum(rows, 1))
    usable = fitted.data & (spread > 0)
    scaled = np.divide(centred, spread, out=np.full(centred.shape, np.nan), where=usable)
    times = analysis.chosen.autocorrelation_time
    worst = int(np.argmax(times))
    lags = int(np.clip(LAGS[2] * times[worst], *LAGS[:2]))
    correlation = mean_autocorrelation(residual, fitted.series, lags)
    memory = draw_autocorrelation(correlation, worst, analysis.robot.joints[worst], len(residual))
    histogram = draw_histogram(scaled.ravel())
    return Gallery((picture("histogram", histogram), picture("autocorrelation", memory)))


def mean_autocorrelation(residual: Array, series: np.ndarray, lags: int) -> Array:
    """Return the autocorrelation of each joint, averaged over series by length, (lags, n)."""
    parts = [residual[series == k] for k in np.unique(series)]
    lags = min(lags, max(min(len(p) for p in parts) // 3, 2))
    total = np.zeros((lags, residual.shape[1]))
    for part in parts:
        found = autocorrelation(part)[:lags]
        total[: len(found)] += len(part) * found
    mean: Array = total / len(residual)
    return mean


def velocity_pictures(analysis: Analysis) -> tuple[Block, ...]:
    """Return the residual on unseen motion over velocity, one picture for each joint."""
    out, robot = analysis.held_out, analysis.robot
    velocity = out.velocity
    measured, predicted = out.to_draw(analysis.selected)
    residual = measured - predicted
    speeds, forces = velocity_units(robot), torque_units(robot)
    most = int(np.clip(SCATTER_POINTS // len(robot.joints), 150, 700))
    pictures = []
    for k, joint in enumerate(robot.joints):
        pair = velocity[:, k], residual[:, k]
        figure = draw_residual_velocity(*pair, joint, (speeds[k], forces[k]), most)
        pictures.append(picture("velocity", figure, joint=joint))
    return fold_gallery(gallery("velocity", pictures))


def fold_gallery(whole: Gallery) -> tuple[Block, ...]:
    """Return the first `SHOWN` pictures and a fold with those beyond."""
    rest = whole.pictures[SHOWN:]
    first = replace(whole, pictures=whole.pictures[:SHOWN])
    return (first, Fold(f"{len(rest)} more joints", (Gallery(rest),))) if rest else (first,)
