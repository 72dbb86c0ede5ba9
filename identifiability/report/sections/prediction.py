"""Measured against predicted torque on unseen motion, and what is left."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.noise.autocorrelation import autocorrelation
from identifiability.estimation.torque_errors import WINDOW, WINDOWS
from identifiability.foundation.names import Array
from identifiability.report.blocks import Block, Fold, Gallery, Picture, Section
from identifiability.report.figures import (
    draw_autocorrelation,
    draw_histogram,
    draw_residual_velocity,
    draw_torque,
)
from identifiability.report.figures.torque import choose_stretch
from identifiability.report.numbers import digits, error_text, time_text
from identifiability.report.sections.facts import (
    model_title,
    torque_units,
    unseen_samples,
    velocity_units,
)
from identifiability.report.tables import Column, Table
from identifiability.workflows.analyze import Analysis

#: Joints that are shown at once; those beyond are folded.
SHOWN = 6

#: Points of all torque lines, and of all scatter plots, of a page.
LINE_POINTS, SCATTER_POINTS = 18_000, 5_000

#: Lags of the autocorrelation that are shown: least, most, and per autocorrelation time.
LAGS = (40, 400, 12.0)


def section_prediction(analysis: Analysis) -> Section:
    """Return measured and predicted torque of every joint along a stretch of unseen motion."""
    name = model_title(analysis.chosen)
    samples = unseen_samples(analysis)[0]
    times = analysis.held_out.t[0]
    first = analysis.held_out.series[: len(times)] == analysis.held_out.series[:1]
    part = choose_stretch(times[first])
    shown = times[part]
    span = f", t = {shown[0]:.3g} … {shown[-1]:.3g} s," if len(shown) > 1 else ""
    kind = "a log that" if analysis.validation else "stretches of a log that"
    lead = f"Torque along {samples.name}{span} predicted by {name} from {kind} it had not seen."
    if not (analysis.held_out.whole and analysis.fitted.whole):
        lead += (
            " Errors are of every sample; pictures and autocorrelations are of "
            f"{WINDOWS} windows of {WINDOW} samples of each long log."
        )
    blocks = (*torque_pictures(analysis, part), joint_table(analysis))
    if len(analysis.held_out.t) > 1:
        blocks = (*blocks, log_table(analysis))
    return Section("prediction", "Measured and predicted torque", lead, blocks)


def torque_pictures(analysis: Analysis, part: slice) -> tuple[Block, ...]:
    """Return one picture for each joint over a part of the first unseen log."""
    joints, units = analysis.robot.joints, torque_units(analysis.robot)
    out = analysis.held_out
    t = out.t[0][part]
    tau = out.tau[: len(out.t[0])][part]
    predicted = out.predicted[: len(out.t[0]), :, analysis.selected][part]
    errors = out.joint_error()[:, analysis.selected]
    most = int(np.clip(LINE_POINTS // (3 * len(joints)), 200, 1500))
    width = {1: 720, 2: 500}.get(len(joints), 400)
    pictures = []
    for k, joint in enumerate(joints):
        title = f"{joint}, error {error_text(errors[k])}"
        figure = draw_torque(t, tau[:, k], predicted[:, k], title, units[k], most, width)
        alt = f"Measured and predicted torque of {joint} over time, and the residual"
        pictures.append(Picture(figure, alt=alt))
    return fold_gallery(pictures, "")


def joint_table(analysis: Analysis) -> Table:
    """Return the errors of each joint by itself."""
    fitted, out, m = analysis.fitted, analysis.held_out, analysis.selected
    time = "autocorrelation time [samples]"
    columns = (
        Column("joint"),
        Column("measured, rms", digits(3)),
        Column("unit"),
        Column("error, fitted", error_text),
        Column("error, unseen", error_text),
        Column(time, time_text, "Of the residual on the fitted motion."),
    )
    rows = zip(
        analysis.robot.joints,
        out.rms,
        torque_units(analysis.robot),
        fitted.joint_error()[:, m],
        out.joint_error()[:, m],
        analysis.chosen.autocorrelation_time,
        strict=True,
    )
    return Table.of(
        "Each joint by itself, relative to how much its own torque varies", columns, rows
    )


def log_table(analysis: Analysis) -> Table:
    """Return the error of the selected and of the unpruned model on each unseen log."""
    out = analysis.held_out
    columns = (
        Column("log"),
        Column("samples", "number"),
        Column(f"error, {analysis.chosen.name}", error_text),
        Column(f"error, {analysis.full.name}", error_text),
    )
    errors = [out.relative_error(k) for k in range(len(out.t))]
    rows = [
        (s.name, s.outputs, error[analysis.selected], error[0])
        for s, error in zip(unseen_samples(analysis), errors, strict=True)
    ]
    return Table.of("Each log by itself", columns, rows)


def section_residuals(analysis: Analysis) -> Section:
    """Return distribution, memory and place of the residual."""
    lead = (
        "Is it noise? The intervals assume residuals that are about normal and forget quickly; "
        "what they remember is paid for in σ_robust. A curve over velocity that leaves zero points "
        "to an effect that the model lacks."
    )
    return Section(
        "residuals", "What is left", lead, (noise_pictures(analysis), *velocity_pictures(analysis))
    )


def noise_pictures(analysis: Analysis) -> Gallery:
    """Return the distribution and the autocorrelation of the residual on the fitted motion."""
    fitted = analysis.fitted
    residual = fitted.residual[:, :, analysis.selected]
    spread = residual.std(0)
    scaled = (residual - residual.mean(0)) / np.where(spread > 0, spread, np.nan)
    times = analysis.chosen.autocorrelation_time
    worst = int(np.argmax(times))
    lags = int(np.clip(LAGS[2] * times[worst], *LAGS[:2]))
    correlation = mean_autocorrelation(residual, fitted.series, lags)
    histogram = Picture(
        draw_histogram(scaled.ravel()),
        "All joints together, each in units of its own standard deviation; what lies beyond is "
        "counted in the last bars.",
        "Distribution of the residuals",
    )
    memory = Picture(
        draw_autocorrelation(correlation, worst, analysis.robot.joints[worst], len(residual)),
        "The joint with the longest memory in colour, the others in grey. White noise stays in "
        "the band.",
        "Autocorrelation of the residuals",
    )
    return Gallery((histogram, memory))


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
    residual = out.residual[:, :, analysis.selected]
    speeds, forces = velocity_units(robot), torque_units(robot)
    most = int(np.clip(SCATTER_POINTS // len(robot.joints), 150, 700))
    pictures = [
        Picture(
            draw_residual_velocity(
                velocity[:, k], residual[:, k], joint, (speeds[k], forces[k]), most
            ),
            alt=f"Residual of {joint} over its velocity",
        )
        for k, joint in enumerate(robot.joints)
    ]
    caption = (
        "Residual on unseen motion over velocity; the line joins medians of ten equally filled "
        "bins. A step at zero is Coulomb friction, a slope viscous friction, a hook near zero "
        "Stribeck friction."
    )
    return fold_gallery(pictures, caption)


def fold_gallery(pictures: list[Picture], caption: str) -> tuple[Block, ...]:
    """Return the first `SHOWN` pictures and a fold with those beyond."""
    first = Gallery(tuple(pictures[:SHOWN]), caption)
    rest = tuple(pictures[SHOWN:])
    if not rest:
        return (first,)
    return first, Fold(f"{len(rest)} more joints", (Gallery(rest),))
