"""The report on an `Excitation`: the motion to measure, and what it is worth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.names import Array, shorten_paths
from identifiability.foundation.rounding import digits, format_count, format_number, join
from identifiability.report.blocks import Fold, Gallery, Prose, Section, Sketch, picture, section
from identifiability.report.drawing import (
    BLUE,
    DASHED,
    INK,
    VERMILION,
    canvas,
    drawn,
    label_axes,
    log_scale,
    row_canvas,
    row_lines,
)
from identifiability.report.skeleton import Part, actuated_pose, sketch_parts
from identifiability.workflows.answers import sentence, words
from identifiability.workflows.excite.result import Excitation
from identifiability.workflows.excite.rules import RULES

# An exciting motion: each joint within its limits, the search, and what it gains.


@drawn
def draw_joint(
    t: Array, parts: Sequence[Array], bounds: tuple[Array, Array], title: str, unit: str
) -> Figure:
    """Draw position, velocity and acceleration of a joint between their limits.

    Parameters
    ----------
    t : (N,) [s]
    parts : three of (N,) [unit, unit/s, unit/s²]
    bounds : (3,), (3,)
        Least and largest of each.
    title, unit : str
    """
    figure, axes = canvas(400, 330, (66, 10, 34, 38), (1, 1, 1))
    labels = (f"q [{unit}]", f"q̇ [{unit}/s]", f"q̈ [{unit}/s²]")
    for ax, y, low, high, label in zip(axes, parts, *bounds, labels, strict=True):
        for bound in (low, high):
            ax.axhline(bound, color=VERMILION, **DASHED)
        ax.plot(t, y, color=BLUE, linewidth=1.4)
        room = 0.08 * (high - low)
        ax.set_ylim(low - room, high + room)
        label_axes(ax, "time [s]" if ax is axes[-1] else "", label, title if ax is axes[0] else "")
        ax.locator_params(axis="y", nbins=4)
    axes[-1].set_xlim(float(t[0]), float(t[-1]))
    figure.align_ylabels(axes)
    return figure


@drawn
def draw_gain(names: Sequence[str], ratio: Array) -> Figure:
    """Draw standard deviations relative to those of the motion compared with.

    Parameters
    ----------
    names : sequence of str
    ratio : (k,)
    """
    figure, axes = row_canvas(names, xlabel="σ with this motion / σ compared with")
    shown = np.where(np.isfinite(ratio) & (ratio > 0), ratio, 1.0)
    log_scale(axes, 0.8 * float(shown.min(initial=0.5)), 1.25 * float(shown.max(initial=2.0)))
    _plain_ticks(axes.xaxis, *axes.get_xlim())
    row_lines(axes, len(names))
    axes.axvline(1.0, color=INK, linewidth=1)
    colours = np.where(shown <= 1, BLUE, VERMILION)
    axes.scatter(shown, np.arange(len(names)), c=colours.tolist(), s=36, zorder=3)
    return figure


def _plain_ticks(axis: Axis, low: float, high: float) -> None:
    """Write plain numbers 1, 2, 5, 10 … along a logarithmic axis, fewer where it is long."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    leading = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    ticks = [lead * 10.0**k for k in decades for lead in leading]
    axis.set_major_locator(FixedLocator([x for x in ticks if low <= x <= high]))
    axis.set_major_formatter(FuncFormatter(lambda x, _: format_number(x, 2)))
    axis.set_minor_locator(NullLocator())


# What an excitation answers first: what to play, what it tells, whether it is safe, what next.


def sketch(result: Excitation) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    owners: dict[str, list[str]] = {}
    known = dict.fromkeys(n.rpartition(".")[0] for n in result.names)
    for name, gain in zip(result.names, result.gain, strict=True):
        if gain < RULES.better:
            owners.setdefault(name.rpartition(".")[0], []).append(name)
    parts = {
        owner: Part("green", f"better known: {join(owners[owner])}")
        if owner in owners
        else Part("grey", "not better known")
        for owner in known
    }
    q = result.motion[1]
    pose = actuated_pose(result.robot, q)
    return sketch_parts(result.robot, parts, "decision.excited", pose, "not in the model")


# The report on an `Excitation`: the motion to measure, and what it is worth.


TITLES = {
    "information": "A motion that says much about the parameters",
    "separate": "A motion that separates two effects",
    "discriminate": "A motion that tells effects of known size apart",
}


def heading(result: Excitation) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    return "Excitation report", (
        f"{TITLES[result.criterion.name]} · {format_number(result.trajectory.period)} s, "
        f"{format_count(result.trajectory.samples, 'sample')}"
    )


def paragraphs(result: Excitation) -> tuple[str, ...]:
    """Return the answer in words."""
    return (result.statement, *result.hints)


def sections(result: Excitation) -> list[Section]:
    """Return the sections of the page."""
    return [section_motion(result), section_gain(result), section_method(result)]


def section_motion(result: Excitation) -> Section:
    """Return every joint along the motion, and the limits it keeps."""
    t, *parts = result.motion
    limits, robot = result.limits, result.robot
    slides = [robot.is_prismatic(int(k)) for k in robot.actuated]
    pictures = []
    for k, joint in enumerate(limits.joints):
        unit = "m" if slides[k] else "rad"
        highest = np.array([limits.high[k], limits.speed[k], limits.acceleration[k]])
        lowest = np.array([limits.low[k], -limits.speed[k], -limits.acceleration[k]])
        figure = draw_joint(t, [x[:, k] for x in parts], (lowest, highest), joint, unit)
        pictures.append(picture("joint", figure, joint=joint))
    return section(
        "excitation.motion",
        Gallery(tuple(pictures)),
        result.tables()[0],
        Fold("Coefficients", (_coefficients(result),)),
    )


def _coefficients(result: Excitation) -> Table:
    path = result.trajectory
    kinds = [f"{kind} {k + 1}" for kind in ("sin", "cos") for k in range(path.sin.shape[1])]
    columns = [Column("joint"), *(Column(kind, digits(5)) for kind in ("offset", *kinds))]
    numbers = np.column_stack([path.offset, path.sin, path.cos])
    rows = [(joint, *x) for joint, x in zip(result.limits.joints, numbers, strict=True)]
    caption = "q = offset + Σ sin k/(kω) sin(kωt) − cos k/(kω) cos(kωt), ω = 2π/period"
    return Table.of(caption, columns, rows, cards=False)


def section_gain(result: Excitation) -> Section:
    """Return what the motion tells of each parameter, and how the search went."""
    gain = picture("gain", draw_gain(result.names, result.gain), beside=result.beside)
    return section("excitation.gain", gain, beside=result.beside)


def section_method(result: Excitation) -> Section:
    """Return how the motion was found, for those who repeat it."""
    logs = ", ".join(shorten_paths(result.logs))
    text = words(
        "excitation.how",
        harmonics=result.trajectory.harmonics,
        motions=format_count(result.evaluations, "motion"),
        seed=result.seed,
        effects=", ".join(result.effects),
        measured=sentence("excitation.measured", logs=logs) if logs else "",
    )
    shown = tuple(text[name] for name in ("how", "model", "run_in"))
    return section("excitation.method", Prose(shown))
