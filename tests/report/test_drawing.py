"""Figures become inline SVG that is themed, harmless, small and always the same."""

import re

import numpy as np
import pytest

from identifiability.report import figures, svg
from identifiability.report.figures import peak_rows

pytestmark = pytest.mark.pictures

INF, NAN = np.inf, np.nan
HOSTILE = [
    "<script>alert(1)</script>",
    "a$b$c",
    'quote" id="x',
    "</svg>",
    "\\alpha \\$",
    "控制\n器",
]


def draw_first(names, value=1.0):
    """Return one figure, for what is so of each."""
    x = np.full(len(names), value)
    kinds = ["identifiable", "sign only", "negligible", "not identifiable", "something new"] * 2
    return figures.draw_precision(names, x, 2 * x, kinds[: len(x)], 20.0, 10 * value)


def draw_all(names, value=1.0):
    """Return every figure with the same names and values."""
    k = len(names)
    x = np.full(k, value)
    t = np.linspace(0.01, 1, 50)
    wave = value * np.sin(9 * t)
    return [
        draw_first(names, value),
        figures.draw_ladder(np.arange(k)[::-1] + 1.0, x, x, x, 0, "x"),
        figures.draw_torque(t, wave, np.sin(9 * t), names[0], "N·m"),
        figures.draw_curve(t, wave, t, t, names[0], ("velocity [rad/s]", "torque [N·m]")),
        figures.draw_intervals(names, x, np.abs(x), "mass [kg]"),
    ]


MORE = (pytest.param(x, marks=pytest.mark.everything) for x in (0.0, INF, 1.0, -1.0, 1e-30))


@pytest.mark.parametrize("value", [NAN, 1e30, *MORE])
def test_every_figure_survives_any_number(value):
    for figure in draw_all(["a", "b"], value):
        assert svg(figure).startswith("<svg viewBox=")


def test_names_from_files_are_drawn_as_they_stand_and_do_nothing():
    for figure in draw_all(HOSTILE):
        text = svg(figure, HOSTILE[0])
        assert "<script" not in text
        assert text.count("</svg>") == 1
        assert not any('id="x' in tag for tag in re.findall(r"<[^<>]*>", text))
    text = svg(draw_first(HOSTILE))
    assert "a$b$c" in text  # no mathematics
    assert "控制 器" in text


def test_every_axis_has_a_label_with_a_unit():
    for figure in draw_all(["a", "b"]):
        lowest = figure.axes[-1]
        assert lowest.get_xlabel().endswith("]")
        for axes in figure.axes:
            named_rows = axes.get_ylabel() == "" and len(figure.axes) == 1
            assert named_rows or axes.get_ylabel().endswith("]")


def test_torque_that_is_no_curve_of_its_motion_is_drawn_over_the_fitted_torque():
    x, learned = np.random.default_rng(0).normal(size=(2, 200))
    labels = ("velocity [rad/s]", "torque [N·m]")
    drawn = [figures.draw_curve(x, y, 0 * x, y, "a", labels) for y in (learned, np.sign(x))]
    assert [f.axes[0].get_xlabel() for f in drawn] == ["fitted torque [N·m]", labels[0]]


def test_thin_lines_keep_their_peaks():
    y = np.sin(np.arange(10_000.0) / 900)
    y[[1234, 8765]] = 40, -40
    rows = peak_rows((y,), 500)
    assert len(rows) <= 500
    assert (y[rows].max(), y[rows].min()) == (40, -40)


def test_lines_are_broken_at_gaps():
    t = np.concatenate([np.arange(5.0), 50 + np.arange(4.0)])
    line = figures.draw_torque(t, t, t, "a", "N").axes[0].lines[0]
    assert np.flatnonzero(np.isnan(line.get_ydata())).tolist() == [5]
    assert (np.diff(line.get_xdata()) > 0).all()
