"""`Profile`: the rise of the deviance as one number leaves its best value and the rest is refitted.

What to use when: `profile` takes any number and a function that refits the rest; `ShapeRefits` is
that function for the shape of an effect. The curvature at the best value gives no interval where a
number enters nonlinearly or has a limit; the likelihood ratio does [Venzon & Moolgavkar 1988].
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import scipy

from identifiability.effects import Part, Placed, find_family
from identifiability.effects.effect import EXPONENT, Shaped, measure_spans
from identifiability.foundation.linalg import RANK_TOLERANCE, or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import REACH
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Json, frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.information import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure

from .noise import ARNoise, whiten_chunk

#: Function that fixes a number at a value and refits the rest. It returns the deviance (−2 log
#: likelihood up to a constant, infinite for an impossible value) and the fitted values (k,).
Refit = Callable[[float], tuple[float, Array]]

#: Rounds in which a grid is refined or extended, and the pieces that a cell is divided into.
ROUNDS, PIECES = 5, 4
#: A minimum is exact enough where the deviance rises by less to both neighbours.
EXACT: Tolerance = 1.0
#: An end of a region is exact enough where the deviance rises by less within its cell.
ROUGH: Tolerance = 8.0
#: Points of the grid of a shape, and how far it reaches beyond the shapes that are searched.
POINTS = 24
BEYOND: Tolerance = 8.0


@frozen
class Number:
    """A number to profile.

    Attributes
    ----------
    name, unit : str
    least, most : float
        Limits of its values.
    logarithmic : bool
        Whether its curve is a function of its logarithm.
    limits : (str, str)
        Effects that take the place of its effect at these limits; empty where none is needed.
    """

    name: str
    unit: str
    least: float = -np.inf
    most: float = np.inf
    logarithmic: bool = False
    limits: tuple[str, str] = ("", "")

    def scale(self, values: Array) -> Array:
        """Return the coordinates of values, (g,)."""
        if self.logarithmic:
            return np.log(values)
        return np.asarray(values, float)

    def unscale(self, coordinates: Array) -> Array:
        """Return the values at coordinates, (g,)."""
        values = np.exp(coordinates) if self.logarithmic else np.asarray(coordinates, float)
        return np.clip(values, self.least, self.most)


@frozen
class Profile:
    """The curve of a number.

    Attributes
    ----------
    number : Number
    grid : (g,) [unit of the number]
        Ascending.
    deviance : (g,)
    fitted : (g, k)
        Values of the refitted rest.
    freedom : float
        Rows minus fitted values. A larger deviance is a lack of fit and widens the region.
        Infinite if the deviance has the measured size of the residual.
    """

    number: Number
    grid: Array
    deviance: Array
    fitted: Array
    freedom: float = np.inf

    @cached_property
    def coordinates(self) -> Array:
        """Coordinates of the grid, (g,)."""
        return self.number.scale(self.grid)

    @cached_property
    def at(self) -> int:
        """The grid point with the least deviance."""
        return int(np.argmin(self.deviance))

    @cached_property
    def unit(self) -> float:
        """Deviance that counts as one."""
        return max(float(self.deviance[self.at]) / self.freedom, 1.0)

    @cached_property
    def parabola(self) -> tuple[float, float, float]:
        """Offset of the minimum from its grid point, depth there below it, and half curvature.

        All are zero at an end of the curve.
        """
        near = slice(self.at - 1, self.at + 2)
        interior = 0 < self.at < len(self.grid) - 1
        inside = interior and np.isfinite(self.deviance[near]).all()
        if not inside:
            return 0.0, 0.0, 0.0
        x = self.coordinates[near] - self.coordinates[self.at]
        y = (self.deviance[near] - self.deviance[self.at]) / self.unit
        slopes = y[[0, 2]] / x[[0, 2]]
        half = float((slopes[1] - slopes[0]) / (x[2] - x[0]))
        slope = float(slopes[0] - half * x[0])
        if not half > 0:
            return 0.0, 0.0, 0.0
        return -slope / (2 * half), slope**2 / (4 * half), half

    @property
    def best(self) -> float:
        """Value with the least deviance."""
        return float(self.number.unscale(self.coordinates[self.at] + self.parabola[0]))

    @cached_property
    def rise(self) -> Array:
        """Rise of the deviance over its least value, (g,)."""
        return (self.deviance - self.deviance[self.at]) / self.unit + self.parabola[1]

    @cached_property
    def accepted(self) -> tuple[int, int]:
        """The first and the last grid point that the logs do not exclude at 95 %."""
        inside = np.flatnonzero(self.rise <= REACH**2)
        ends = inside[[0, -1]] if len(inside) else np.array([self.at, self.at])
        return int(ends[0]), int(ends[1])

    @property
    def open(self) -> tuple[bool, bool]:
        """Whether the logs exclude no small value, and no large one."""
        first, last = self.accepted
        return first == 0, last == len(self.grid) - 1

    @cached_property
    def region(self) -> tuple[float, float]:
        """Ends of the 95 % region. An open end is the limit of the number."""
        first, last = self.accepted
        low, high = self.open
        lower = self.number.least if low else self._crossing(first, first - 1)
        upper = self.number.most if high else self._crossing(last, last + 1)
        return lower, upper

    def _crossing(self, inside: int, outside: int) -> float:
        """Return the value between two points where the root of the rise crosses its limit.

        The root is nearly linear.
        """
        if not np.isfinite(self.rise[outside]):
            return float(self.grid[outside])
        start = self.coordinates[inside]
        first, last = np.sqrt(self.rise[[inside, outside]])
        if inside == self.at:
            start = start + self.parabola[0]
            first = 0.0
        share = (REACH - first) / (last - first)
        step = self.coordinates[outside] - start
        return float(self.number.unscale(start + share * step))

    def to_dict(self) -> Json:
        """Return the curve as plain values; open ends without a limit are null."""
        lower, upper = self.region
        return {
            "name": self.number.name,
            "unit": self.number.unit,
            "best": self.best,
            "lower": lower,
            "upper": upper,
            "open": list(self.open),
            "grid": self.grid.tolist(),
            "rise": self.rise.tolist(),
        }

    def finer(self) -> Array:
        """Return further values: about the minimum, at the ends of the region, beyond the grid."""
        u = self.coordinates
        first, last = self.accepted
        ends = [(first - 1, first), (last, last + 1)]
        sharp = [(self.at - 1, self.at), (self.at, self.at + 1)]
        cells = dict.fromkeys(ends, ROUGH) | dict.fromkeys(sharp, EXACT)
        inside = {(a, b): x for (a, b), x in cells.items() if a >= 0 and b < len(u)}
        coarse = [(a, b) for (a, b), x in inside.items() if abs(self.rise[b] - self.rise[a]) > x]
        more = [np.linspace(u[a], u[b], PIECES + 1)[1:-1] for a, b in coarse]
        if not self.number.logarithmic:
            reach = u[-1] - u[0]
            before = [u[0] - reach] * self.open[0]
            more.append(np.array(before + [u[-1] + reach] * self.open[1]))
        return np.setdiff1d(self.number.unscale(np.concatenate([[], *more])), self.grid)


def profile(
    number: Number,
    grid: Array,
    refit: Refit,
    prepare: Callable[[Array], None] | None = None,
) -> Profile:
    """Return the profile of a number: on a grid, then on finer ones where the curve matters.

    Parameters
    ----------
    number : Number
    grid : (g,)
    refit : Refit
    prepare : callable((m,)), optional
        Called with each set of values before they are refitted, so that rows are read once a set.
    """
    found = dict[float, tuple[float, Array]]()
    new = np.unique(grid)
    for _ in range(ROUNDS):
        if prepare is not None:
            prepare(new)
        found |= {float(x): refit(float(x)) for x in new}
        values = np.array(sorted(found))
        deviance, fitted = zip(*(found[x] for x in values.tolist()), strict=True)
        curve = Profile(number, values, np.array(deviance), np.array(fitted))
        new = curve.finer()
        if not new.size:
            break
    return curve


# Shapes of effects, from products of the rows.


@dataclass
class ShapeRefits:
    """Refits of a model with each shape of an effect at a joint, from whitened rows.

    Attributes
    ----------
    structure : Structure
    samples : sequence of Dataset
        The fitted logs.
    noise : ARNoise
    name : str
        Of the shape: ``<joint>.<effect>``.
    """

    structure: Structure
    samples: Sequence[Dataset]
    noise: ARNoise
    name: str
    found: dict[float, tuple[float, Array]] = field(default_factory=dict)
    freedom: float = np.inf

    @property
    def place(self) -> tuple[str, str]:
        """The joint, and the name of the effect."""
        joint, _, family = self.name.rpartition(".")
        return joint, family

    @cached_property
    def number(self) -> Number:
        """The shape as a number."""
        joint, family = self.place
        effect = find_family(family).effect
        slides = {axis.name: axis.prismatic for axis in self.structure.robot.axes}
        unit = "m" if slides[joint] else "rad"
        if find_family(family).continuous:
            unit += "/s"
        limits = effect.limits if isinstance(effect, Shaped) else ("", "")
        return Number(self.name, unit, 0.0, np.inf, True, limits)

    @cached_property
    def grid(self) -> Array:
        """Shapes to begin with, (g,): those that are searched, and far smaller and larger ones."""
        joint, family = self.place
        spans = measure_spans(self.structure.robot, (s.motion for s in self.samples))
        searched = find_family(family).grid(spans[joint])
        stated = self.structure.shapes[self.name]
        ends = min(*searched, stated) / BEYOND, max(*searched, stated) * BEYOND
        return np.append(np.geomspace(*ends, POINTS), stated)

    @cached_property
    def others(self) -> list[int]:
        """Columns of the base parameters without those of the effect."""
        parameters = self.structure.parameters
        kept = self.structure.base.kept.tolist()
        return [k for k in kept if (parameters[k].owner, parameters[k].group) != self.place]

    def prepare(self, values: Array) -> None:
        """Read the rows once, and refit the rest at each of the values."""
        joint, family = self.place
        robot = self.structure.robot
        more = [x for n, x in self.structure.shapes.items() if n == f"{self.name}{EXPONENT}"]
        at = find_family(family).at
        shapes = [(x, *more) if more else x for x in values.tolist()]
        tried = Placed([Part(at(x, joint), joint) for x in shapes])
        levels = tried.parameters(robot)
        first = len(self.structure.parameters)
        columns = np.array([*self.others, *range(first, first + len(levels))])
        model = Model((*self.structure.model.effects, tried))
        regression = Regression(robot, model, tuple(self.samples), columns)
        white = gather_information(regression, transform=partial(whiten_chunk, noise=self.noise))
        F = white.factor(np.array([joint.sigma**-2.0 for joint in self.noise]))
        count = len(self.others)
        each = len(levels) // len(values)
        signed = np.array([False] * count + [p.nonnegative for p in levels[:each]])
        self.freedom = max(white.rows - count - each, 1)
        for k, x in enumerate(values.tolist()):
            own = [*range(count), *range(count + k * each, count + (k + 1) * each)]
            self.found[x] = solve_signed(F, np.array(own), signed)

    def __call__(self, value: float) -> tuple[float, Array]:
        """Return the deviance at a prepared value, and the refitted values."""
        return self.found[value]


def profile_shape(refits: ShapeRefits) -> Profile:
    """Return the profile of the shape of an effect."""
    curve = profile(refits.number, refits.grid, refits, refits.prepare)
    return replace(curve, freedom=refits.freedom)


def solve_signed(F: Array, columns: np.ndarray, signed: np.ndarray) -> tuple[float, Array]:
    """Return the squared residual and the values (m,) of some columns, signed ones not negative.

    Parameters
    ----------
    F : (k + 1, k + 1)
        Factor of ``[W τ]``.
    columns : (m,) int
    signed : (m,) bool
    """
    target = F[:, -1]
    length = or_one(np.linalg.norm(F[:, columns], axis=0))
    A = F[:, columns] / length
    x = np.linalg.lstsq(A, target, rcond=RANK_TOLERANCE)[0]
    if (x[signed] < 0).any():
        least = np.where(signed, 0.0, -np.inf)
        x = scipy.optimize.lsq_linear(A, target, (least, np.inf), method="bvls").x
    residual = target - A @ x
    return float(residual @ residual), x / length
