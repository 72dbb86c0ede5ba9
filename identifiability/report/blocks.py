"""Parts of a page: sections of prose, notes, terms, tables, pictures and folds.

Titles, captions and leads come from `words.toml` (`section`, `picture`, `gallery`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identifiability.foundation.answers import Answer, Cell, Note, Table
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rounding import format_count, format_number
from identifiability.foundation.values import frozen
from identifiability.robot import Robot

from .answers.common import VISIBLE, WORDS, sentence, words
from .figures import break_gaps, name_torque, peak_rows, svg


@frozen
class Prose:
    """Paragraphs."""

    paragraphs: Strings


@frozen
class Notes:
    """Several notes."""

    notes: tuple[Note, ...]


@frozen
class Term:
    """A word and its explanation; `badge` gives it the mark of a verdict."""

    word: str
    text: str
    badge: str = ""
    formula: str = ""


@frozen
class Terms:
    """A list of terms."""

    terms: tuple[Term, ...]


@frozen
class Picture:
    """A figure with its caption.

    Attributes
    ----------
    figure : Figure
        Drawn at one pixel per point; it is scaled to the width that there is.
    caption : str
        What one should see in it.
    alt : str
        For readers who cannot see it; by default the caption.
    name : str
        Its name in `Result.figures`.
    """

    figure: Figure
    caption: str = ""
    alt: str = ""
    name: str = "figure"

    @cached_property
    def markup(self) -> Markup:
        """The figure as SVG."""
        return svg(self.figure, self.alt or self.caption)

    @property
    def width(self) -> int:
        """Width at which its text has the intended size [px]."""
        return round(self.figure.get_figwidth() * 72)


@frozen
class Gallery:
    """Pictures side by side as far as there is room, with one caption."""

    pictures: tuple[Picture, ...]
    caption: str = ""

    @property
    def width(self) -> int:
        """Width of the widest picture [px]."""
        return max((p.width for p in self.pictures), default=0)


@frozen
class Traces:
    """Curves over time, with zoom and values at the pointer.

    Attributes
    ----------
    groups : tuple of Trace
        One is shown at a time, chosen by its name.
    caption : str
    shown : int
        The group that is shown first.
    gaps : str
        What grey bands mean, for groups that have some.
    """

    groups: tuple[Trace, ...]
    caption: str = ""
    shown: int = 0
    gaps: str = ""


@frozen
class Shape:
    """A part of a robot that is drawn: a thick stroke between points, or a plate.

    Attributes
    ----------
    points : tuple of int
        A plate begins and ends at the same point.
    kind : {"base", "body", "joint", "cylinder", "rod"}
    width : float [px]
    """

    points: tuple[int, ...]
    kind: str
    width: float

    @property
    def ahead(self) -> float:
        """Depth by which it is drawn nearer, so that bodies do not hide their joints [px]."""
        return self.width if self.kind == "joint" else 0.0


@frozen
class Moving:
    """Robots along a recording, one over the other, to play and to drag through.

    Attributes
    ----------
    names : tuple of (name, tone)
        Of the robots; the first is drawn broad, behind the others.
    t : (F,) [s]
    points : tuple of (F, P, 3) [px]
        Places and depth of each robot's joints and ends of bodies; NaN where there is none.
    shapes : tuple of Shape
    tips : tuple of int
        Points whose path is drawn.
    ground : tuple of (2, 2) [px]
        Lines of the ground.
    joints : int
        Number of points that are joints; they come first.
    told : tuple of F texts
        Text for each time, for each robot but the first, or for the torque.
    size : (int, int) [px]
    caption : str
    torque : Trace or None
        Of one joint, drawn below with a line at the time that is shown.
    misses : (F, J) or None
        Torque that the model misses in each joint, relative to the largest missed.
    mark : str
        Tone of the dots of these sizes.
    note : str
        Text in the drawing.
    """

    names: tuple[tuple[str, str], ...]
    t: Array
    points: tuple[Array, ...]
    shapes: tuple[Shape, ...]
    tips: tuple[int, ...]
    ground: tuple[Array, ...]
    joints: int
    told: tuple[Strings, ...]
    size: tuple[int, int]
    caption: str = ""
    torque: Trace | None = None
    misses: Array | None = None
    mark: str = "vermilion"
    note: str = ""

    @property
    def data(self) -> str:
        """Data for the script of the page, as JSON: places to a tenth of a pixel."""
        robots = [
            [None if np.isnan(frame).any() else frame.ravel().round(1).tolist() for frame in points]
            for points in self.points
        ]
        misses = [] if self.misses is None else self.misses.round(2).tolist()
        shapes = [(x.points, x.kind, round(x.width, 1), round(x.ahead, 1)) for x in self.shapes]
        times = np.round(self.t, 3).tolist()
        told = {"t": times, "shapes": shapes, "told": self.told, "robots": robots}
        return json.dumps({**told, "misses": misses, "tips": self.tips}, separators=(",", ":"))

    @property
    def floor(self) -> str:
        """The ground as a path."""
        return "".join(_draw_path(line) for line in self.ground)

    def pose(self, robot: int) -> Markup:
        """Return a robot at the first time, as the script moves it: what is far comes first."""
        points = np.nan_to_num(self.points[robot][0])
        drawn = []
        for shape in self.shapes:
            places = points[[*shape.points]]
            path = _draw_path(places[:, :2])
            style = f'd="{path}" style="--wide: {shape.width:.1f}px"'
            both = "".join(
                f'<path class="{x}" {style}/>' for x in (f"edge {shape.kind}", shape.kind)
            )
            drawn.append((float(places[:, 2].mean()) - shape.ahead, both))
        drawn.sort(key=lambda x: -x[0])
        circle = f'<circle class="missed tone-{self.mark}" r="0"/>'
        dot = f'<g class="joint" transform="translate({{}} {{}})">{circle}</g>'
        joints = points[: self.joints, :2].round(1)
        marks = joints.tolist() if self.misses is not None else []
        bodies = "".join(text for _, text in drawn)
        return Markup(f'<g class="bodies">{bodies}</g>{"".join(dot.format(*x) for x in marks)}')

    @property
    def strips(self) -> tuple[Moving, ...]:
        """The drawings of torque: a residual, or a line too small to see, has its own below.

        Lines that stand in the other drawing are NaN, so that each keeps its colour.
        """
        if self.torque is None:
            return (self,)
        lines = {name: np.array(y) for name, y in self.torque.lines.items()}
        sizes = {name: np.nanmax(np.abs(y), initial=0.0) for name, y in lines.items()}
        least = VISIBLE * max(sizes.values())
        small = [name for name, size in sizes.items() if name == "residual" or 0 < size < least]
        if len(small) in (0, len(lines)):
            return (self,)
        parts = (
            {
                name: tuple(np.where((name in small) is below, y, np.nan))
                for name, y in lines.items()
            }
            for below in (False, True)
        )
        return tuple(replace(self, torque=replace(self.torque, lines=part)) for part in parts)

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest torque that is drawn, zero among them."""
        lines = self.torque.lines.values() if self.torque is not None else ()
        every = np.concatenate([[0.0], *map(np.array, lines)])
        return float(np.nanmin(every)), float(np.nanmax(every))

    @property
    def ticks(self) -> list[tuple[str, float]]:
        """Text and height of the round marks of the torque axis, from its top [%]."""
        low, high = self.range
        marks = np.asarray(MaxNLocator(3).tick_values(low, high))
        shown = marks[(low <= marks) & (marks <= high)]
        heights = 100.0 * (high - shown) / (high - low or 1.0)
        return [(format_number(x, 3), y) for x, y in zip(shown, heights, strict=True)]

    @property
    def zero(self) -> float:
        """Where zero is in the drawing of torque [px]."""
        low, high = self.range
        return PLOT[1] * high / (high - low or 1.0)

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Start and width of each stretch without torque, in the box of `PLOT` pixels."""
        if self.torque is None:
            return []
        known = (np.isfinite(y) for y in self.torque.lines.values())
        rows = np.flatnonzero(next(filter(np.any, known), []))
        ends = np.flatnonzero(np.diff(rows) > 1)
        x = PLOT[0] / (self.t[-1] - self.t[0]) * np.array(self.torque.t)[rows]
        begin = [(0.0, float(x[0]))] if len(x) and x[0] > 1.0 else []
        return begin + [(float(x[k]), float(x[k + 1] - x[k])) for k in ends]

    @property
    def plot(self) -> list[tuple[str, str, str]]:
        """Name, tone and path of each line of torque, in a box of `PLOT` pixels."""
        if self.torque is None:
            return []
        (low, high) = self.range
        paths = []
        scale = PLOT[0] / (self.t[-1] - self.t[0])
        x = scale * np.array(self.torque.t)
        for (name, y), tone in zip(self.torque.lines.items(), PLOT_TONES, strict=False):
            heights = PLOT[1] * (high - np.array(y))
            places = np.stack([x, heights / (high - low or 1.0)], 1)
            seen = np.isfinite(places).all(1)
            begins = seen & ~np.append(False, seen[:-1])
            steps = zip(
                begins[seen],
                places[seen].round(1).tolist(),
                strict=True,
            )
            shown = "vermilion" if name == "residual" else tone
            paths.append((name, shown, "".join(f"{'ML'[not b]}{p[0]} {p[1]}" for b, p in steps)))
        return [path for path in paths if path[2]]


def _draw_path(places: Array) -> str:
    """Return places (k, 2) as a path."""
    steps = ("{} {}".format(*place) for place in places.round(1).tolist())
    return f"M{'L'.join(steps)}"


#: Size of the drawing of torque [px], and the colours of its lines but a residual.
PLOT = (400, 110)
PLOT_TONES = ("grey", "blue", "purple", "sky")


@frozen
class Trace:
    """The curves of one joint.

    Attributes
    ----------
    name, unit : str
    t : tuple of float [s]
    lines : mapping
        Name of a line to its values at `t`; NaN breaks a line.
    quantity : str
        What is drawn.
    """

    name: str
    unit: str
    t: tuple[float, ...]
    lines: Mapping[str, tuple[float, ...]]
    quantity: str = "torque"

    @classmethod
    def of(
        cls,
        name: str,
        unit: str,
        t: Array,
        lines: Mapping[str, Array],
        most: int,
        quantity: str = "torque",
    ) -> Trace:
        """Return the peaks of lines (N,), at most a given number of each, broken at gaps."""
        rows = peak_rows(tuple(lines.values()), most)
        times, values = break_gaps(t[rows], [y[rows] for y in lines.values()])
        broken = {n: tuple(y.tolist()) for n, y in zip(lines, values, strict=True)}
        return cls(name, unit, tuple(times.tolist()), broken, quantity)

    @property
    def shown(self) -> str:
        """The quantity in words, with force for torque where the unit says so."""
        return self.quantity.replace("torque", name_torque(self.unit))

    @property
    def data(self) -> str:
        """The lines as JSON with five digits."""
        rows = (self.t, *self.lines.values())
        short = [[None if math.isnan(x) else float(f"{x:.5g}") for x in row] for row in rows]
        axis = f"{self.shown} [{self.unit}]"
        return json.dumps({"x": "time [s]", "axis": axis, "names": [*self.lines], "rows": short})


@frozen
class Answers:
    """The questions of a page and its notes, with a drawing of the robot or of its values."""

    answers: tuple[Answer, ...]
    below: tuple[Block, ...] = ()
    notes: tuple[Block, ...] = ()


@frozen
class Fold:
    """Blocks that open on demand; in print they are open."""

    summary: str
    blocks: tuple[Block, ...]


def check_cell(text: str, passed: bool | None, reason: str = "") -> Cell:
    """Return a number with its check, for a cell of a DataFrame given to `frame_table`.

    `passed` is None if there was no check; the reason is the tolerance, or why it differs.
    """
    word = {True: "pass", False: "differs", None: "not checked"}[passed]
    return Cell(text or word, word, reason, word)


def words_of(table: Table) -> list[tuple[str, int]]:
    """Return the words to filter a table by, in order of appearance, with their counts."""
    words = [row[table.filter_by].badge for row in table.rows if table.filter_by is not None]
    return [(word, words.count(word)) for word in dict.fromkeys(words)]


def count_words(table: Table) -> str:
    """Return the words to filter a table by with their counts."""
    return ", ".join(f"{count} {word}" for word, count in words_of(table))


def sort_key(cell: Cell) -> str | None:
    """Return a cell's key as the page's script reads it; None for the text, empty sorts last."""
    if cell.key is None or isinstance(cell.key, str):
        return cell.key
    if math.isnan(cell.key):
        return ""
    return f"{cell.key:.6g}".replace("inf", "Infinity")


#: Rows that a page shows of a long table, and names that a sentence lists, at most.
SHOWN_FIRST = 12


def kind_of(block: object) -> str:
    """Return the kind of a block, for the choice of its template."""
    return type(block).__name__.lower()


Block: TypeAlias = (
    "Prose | Notes | Terms | Table | Picture | Gallery | Fold | Traces | Moving | Answers | Section"
)


@frozen
class Section:
    """A headed part of a page.

    Attributes
    ----------
    name : str
        Its anchor: letters, digits and hyphens.
    title : str
    lead : str
        One or two sentences that say what is to be seen.
    blocks : tuple
    folded : bool
        Whether only its title and the first sentence of its lead are shown until it is opened.
    """

    name: str
    title: str
    lead: str = ""
    blocks: tuple[Block, ...] = ()
    folded: bool = False


GLOSSARY = tuple(Term(**term) for term in WORDS["glossary"])


def section(name: str, /, *blocks: Block | str | None, **holes: Any) -> Section:
    """Return a section with its title and lead; its anchor is the last part of its name.

    A text becomes a paragraph, None is left out.
    """
    kept = tuple(Prose((b,)) if isinstance(b, str) else b for b in blocks if b is not None)
    key = name.rpartition(".")[2]
    return Section(
        key,
        **words(name, **holes),
        blocks=kept,
    )


def picture(name: str, figure: Figure, /, **holes: Any) -> Picture:
    """Return a figure with its caption and its description for screen readers."""
    return Picture(figure, **words(f"picture.{name}", **holes), name=name)


def gallery(name: str, pictures: Sequence[Picture], /, **holes: Any) -> Gallery:
    """Return several pictures with one caption."""
    return Gallery(tuple(pictures), **words(f"gallery.{name}", **holes))


#: Points of all torque lines of a page.
LINE_POINTS = 18_000

#: Limits beyond so many times the largest value would hide the motion.
FAR = 8.0


def traces(
    t: Array,
    joints: Sequence[str],
    units: Sequence[str],
    lines: Mapping[str, Array],
    quantity: str = "torque",
    caption: str = "",
    shown: int = 0,
) -> Traces:
    """Return curves of joints over time, to zoom, with the one that is shown first.

    Lines (N, n) by their names, NaN where none is.
    """
    groups = []
    most = max(300, LINE_POINTS // (3 * len(joints)))
    for k, (joint, unit) in enumerate(zip(joints, units, strict=True)):
        own = {name: y[:, k] for name, y in lines.items()}
        there = {name: y for name, y in own.items() if not np.isnan(y).all()}
        groups.append(
            Trace.of(
                joint,
                unit,
                t,
                there or own,
                most,
                quantity,
            )
        )
    return Traces(tuple(groups), caption, shown)


def motion_traces(
    quantity: str,
    t: Array,
    values: Array,
    joints: Sequence[str],
    units: Sequence[str],
    limits: Array | None,
) -> Traces:
    """Return curves of joints over time, with their limits as a band.

    Parameters
    ----------
    quantity : str
    t : (N,) [s]
    values : (N, n)
    joints, units : sequence of n str
    limits : (n, 2), optional
        Least and largest; NaN or infinite without.
    """
    lines = {quantity: values}
    if limits is not None:
        far = FAR * np.maximum(np.abs(values).max(0), TINY)
        for name, bound in zip(("least", "largest"), limits.T, strict=True):
            shown = np.where(np.abs(bound) < far, bound, np.nan)
            lines[f"{name} allowed"] = np.tile(shown, (len(t), 1))
    return traces(t, joints, units, lines, quantity)


def torque_lines(measured: Array, predicted: Array) -> dict[str, Array]:
    """Return measured torque, predicted torque and the residual by the names of their lines."""
    return {"measured": measured, "predicted": predicted, "residual": measured - predicted}


def torque_traces(
    t: Array,
    measured: Array,
    predicted: Array,
    joints: Sequence[str],
    units: Sequence[str],
    log: str,
    half: Array | None = None,
) -> Traces:
    """Return measured torque, predicted torque and the residual (N, n) along a log, to zoom.

    The joint with the largest relative residual is shown first. With half widths of 95 % intervals
    (N, n) the prediction has a band.
    """
    lines = torque_lines(measured, predicted)
    if half is not None:
        known = np.where(np.isfinite(half), half, np.nan)
        lines |= {"95 % from": predicted - known, "95 % to": predicted + known}
    caption = sentence("analysis.traces", log=log)
    missed = (np.ma.masked_invalid(lines["residual"]) ** 2).mean(0)
    relative = missed / np.ma.masked_invalid(measured).var(0)
    worst = int(relative.filled(0.0).argmax())
    drawn = traces(t, joints, units, lines, caption=caption, shown=worst)
    return replace(drawn, gaps=sentence("moving", "gaps"))


def count_joints(robot: Robot) -> str:
    """Return the number of joints with motors, and whether the base floats."""
    motors = len(robot.motor_joints)
    said = [format_count(motors, "actuated joint")] if motors or robot.base is None else []
    return " · ".join([*said, *(["floating base"] if robot.base is not None else [])])
