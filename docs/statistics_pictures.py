"""The statistics behind a report, in four pictures; ``python docs/statistics_pictures.py``.

Each is computed: the first three from small simulated fits, the last from the sample logs of the
3-RPS. They stand in docs/statistics/pictures.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from identifiability import Robot, analyze
from identifiability.simulation.simulator import ar1

IMAGES = Path(__file__).resolve().parent / "images"
STYLE = resources.files("identifiability.report") / "templates" / "page.mplstyle"

GOOD, DOUBT, BAD, INK = "#2a7f62", "#b7791f", "#b5483a", "#39424c"


def alike() -> Figure:
    """Two columns that move alike: each value is open, their sum is not."""
    rng = np.random.default_rng(1)
    one = rng.standard_normal(200)
    figure = Figure((8, 3.4), layout="constrained")
    for axes, share, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True),
        (0.1, 0.97),
        ("a motion that tells them apart", "a motion that does not"),
        strict=True,
    ):
        other = share * one + np.sqrt(1 - share**2) * rng.standard_normal(200)
        W = np.column_stack([one, other])
        C = np.linalg.inv(W.T @ W)
        draws = rng.multivariate_normal([2.0, 1.0], C, 120)
        axes.plot(*draws.T, ".", color=INK, alpha=0.25, markersize=3)
        size, turn = np.linalg.eigh(C)
        angle = np.degrees(np.arctan2(turn[1, 1], turn[0, 1]))
        width, height = 2 * np.sqrt(5.99 * size[::-1])
        colour = GOOD if share < 0.5 else BAD
        axes.add_patch(Ellipse((2, 1), width, height, angle=angle, fill=False, color=colour, lw=2))
        axes.set_title(title)
        axes.set_xlabel("first parameter")
    figure.axes[0].set_ylabel("second parameter")
    return figure


def remembering() -> Figure:
    """Noise that remembers: intervals of white noise hold the truth too seldom."""
    rng = np.random.default_rng(2)
    N, truth, motion = 400, 1.0, np.sin(np.linspace(0, 12, 400))
    figure = Figure((8, 3.6), layout="constrained")
    for axes, robust in zip(figure.subplots(1, 2, sharey=True), (False, True), strict=True):
        noise = ar1((N, 40), 0.95, np.random.default_rng(3))
        tau = truth * motion[:, None] + noise
        value = motion @ tau / (motion @ motion)
        left = tau - motion[:, None] * value
        white = np.sqrt(left.var(0, ddof=1) / (motion @ motion))
        if robust:  # blocks of 50 samples, resampled
            scores = (motion[:, None] * left).reshape(8, 50, 40).sum(1)
            pick = rng.integers(8, size=(400, 8))
            white = (scores[pick].sum(1) / (motion @ motion)).std(0) * np.sqrt(8 / 7)
        holds = np.abs(value - truth) < 1.96 * white
        for k in range(40):
            colour = GOOD if holds[k] else BAD
            axes.plot([k, k], value[k] + 1.96 * white[k] * np.array([-1, 1]), color=colour, lw=2)
        axes.axhline(truth, color=INK, lw=1)
        kind = "σ robust: blocks of time are resampled" if robust else "σ: as if noise were white"
        axes.set_title(f"{kind}\n{holds.sum()} of 40 intervals hold the truth")
        axes.set_xlabel("repetition")
    figure.axes[0].set_ylabel("95 % interval")
    return figure


def verdicts() -> Figure:
    """Which interval gets which verdict."""
    rows = (
        ("identifiable", 1.0, 0.07, GOOD, "σ ≤ 20 % and the sign is certain"),
        ("sign only", 0.9, 0.28, DOUBT, "the sign is certain, the rest is not"),
        ("negligible", 0.01, 0.04, INK, "no value in it moves the torque that matters"),
        ("not identifiable", 0.35, 0.45, BAD, "zero and the other sign fit as well"),
    )
    figure = Figure((8, 2.6), layout="constrained")
    axes = figure.subplots()
    axes.axvspan(-0.15, 0.15, color=INK, alpha=0.12, lw=0)
    axes.axvline(0, color=INK, lw=1)
    for k, (_, value, sigma, colour, why) in enumerate(rows):
        axes.plot([value - 1.96 * sigma, value + 1.96 * sigma], [k, k], color=colour, lw=4)
        axes.plot(value, k, "o", color=colour, markersize=8)
        axes.text(1.65, k, why, va="center", color=INK)
    axes.set_yticks(range(len(rows)), [row[0] for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(-0.7, 3.4)
    axes.set_xticks([0], ["0"])
    axes.grid(visible=False)
    axes.set_xlabel("95 % interval of a parameter; grey: too small to matter", loc="left")
    return figure


def fewer() -> Figure:
    """Fewer parameters fit worse and predict better, on the sample logs of the 3-RPS."""
    robot = Robot.load("3-rps")
    logs = sorted(robot.path.parent.glob("logs/run*.csv"))
    models = analyze(robot, logs[:2], validate=logs[2], replicates=50).models
    size = [len(m.submodel) for m in models]
    figure = Figure((8, 3.2), layout="constrained")
    axes = figure.subplots()
    for motion, colour, name in (
        ("fitted", INK, "motion that was fitted"),
        ("unseen", GOOD, "motion that was not"),
    ):  # by the estimates: a real robot's values are held by its bodies
        error = [100 * float(getattr(m, motion).relative_error()[0]) for m in models]
        axes.plot(size, error, "o-", color=colour)
        axes.text(size[0] + 1, error[0], name, va="center", color=colour)
    axes.set_xlim(10, 47)
    axes.set_xticks(size)
    axes.set_xlabel("parameters in the model")
    axes.set_ylabel("error of the force, %")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "alike": alike,
    "remembering": remembering,
    "verdicts": verdicts,
    "fewer": fewer,
}


def main() -> None:
    """Draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", default=list(FIGURES), help=", ".join(FIGURES))
    with mpl.rc_context(fname=str(STYLE)):
        mpl.rcParams["svg.fonttype"] = "path"  # looks alike wherever it is shown
        mpl.rcParams["figure.facecolor"] = "white"  # … also on dark pages
        for name in parser.parse_args().names:
            path = IMAGES / f"{name}.svg"
            FIGURES[name]().savefig(path, metadata={"Date": None})
            print(f"{path.relative_to(IMAGES.parents[1])}: {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main()
