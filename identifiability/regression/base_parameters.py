"""Base parameters: which parameters a motion can determine at all, and which only in combination.

The rank comes from the column-scaled singular values and is returned with its gap. The columns
that represent the groups are chosen by the user's preference: a column is kept if it does not lie
in the span of those kept before it; the others are regrouped into the kept ones [Gautier 1991].
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np

from identifiability.foundation.linalg import (
    RANK_TOLERANCE,
    SPAN_TOLERANCE,
    scan_columns,
    triangular_factor,
)
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.options import Expected, Rng, checked
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen
from identifiability.regression.regression import Model
from identifiability.robot import KnownRobot, Motion, Robot, complete_motion

if TYPE_CHECKING:
    import pandas as pd


@frozen
class BaseParameters:
    """Groupings ``beta = G phi`` of standard parameters phi, with ``W phi = W[:, kept] beta``.

    Attributes
    ----------
    parameters : tuple of Parameter
        The p standard parameters.
    kept : (b,) int
        The column that represents each group.
    G : (b, p)
        Identity on the kept columns; a regrouping is a row.
    singular_values : (min(rows, used columns),)
        Of the column-scaled regressor, descending.
    ambiguous : bool
        Whether the number of kept columns and the numerical rank disagree.
    order : tuple of int
        In which labels list the members of a group.
    """

    parameters: tuple[Parameter, ...]
    kept: np.ndarray
    G: Array
    singular_values: Array
    ambiguous: bool
    order: tuple[int, ...]

    def __len__(self) -> int:
        """Return the number of base parameters, the rank."""
        return len(self.kept)

    @property
    def rank(self) -> int:
        """Number of independent columns."""
        return len(self.kept)

    @property
    def gap(self) -> tuple[float, float]:
        """Smallest scaled singular value kept and largest dropped, relative to the largest."""
        s = self.singular_values / self.singular_values[0] if len(self.singular_values) else [0.0]
        last = float(s[self.rank - 1]) if self.rank else 0.0
        return last, float(s[self.rank]) if self.rank < len(s) else 0.0

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the kept parameters."""
        return tuple(self.parameters[k].name for k in self.kept)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units of the kept parameters."""
        return tuple(self.parameters[k].unit for k in self.kept)

    @property
    def without_effect(self) -> tuple[str, ...]:
        """Standard parameters that never change the torque."""
        idle = ~np.any(np.abs(self.G) > SPAN_TOLERANCE, axis=0)
        return tuple(p.name for p, i in zip(self.parameters, idle, strict=True) if i)

    def terms(self, row: int) -> list[tuple[float, Parameter]]:
        """Return the members of a group with their coefficients, the kept one first."""
        order = [self.kept[row], *[k for k in self.order if k != self.kept[row]]]
        return [
            (float(self.G[row, k]), self.parameters[k])
            for k in order
            if abs(self.G[row, k]) > SPAN_TOLERANCE
        ]

    def label(self, row: int) -> str:
        """Return a grouping as text, ``m(5) − 2.531·my(3) + m(3) + m(2)``."""
        text = ""
        for coefficient, parameter in self.terms(row):
            sign = "−" if coefficient < 0 else "+"
            # Twice: 0.22815 ± rounding must not be 0.2281 here and 0.2282 on another processor.
            size = f"{float(f'{abs(coefficient):.10g}'):.4g}"
            term = parameter.term if size == "1" else f"{size}·{parameter.term}"
            text += f" {sign} {term}" if text else (f"−{term}" if sign == "−" else term)
        return text

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Labels of all groups."""
        return tuple(self.label(row) for row in range(len(self)))

    @property
    def nonnegative(self) -> np.ndarray:
        """Whether physics forbids a value below zero, (b,) bool.

        A sum of masses, diagonal inertias or friction levels with positive coefficients cannot be
        negative; a group with any other member can.
        """
        return np.array(
            [all(c > 0 and p.nonnegative for c, p in self.terms(r)) for r in range(len(self))], bool
        )

    def _repr_html_(self) -> str:
        total = len(self.parameters)
        said = f"{self.rank} of {total} parameters can be told apart, in these sums:"
        return shown(said, self.to_frame(), "to_frame()")

    def to_frame(self) -> pd.DataFrame:
        """Return name, unit and grouping of every base parameter."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        return pd.DataFrame({"name": self.names, "unit": self.units, "grouping": self.labels})


def group_columns(
    W: Array, parameters: Sequence[Parameter], preference: Sequence[int] | None = None
) -> BaseParameters:
    """Return the base parameters of a regressor.

    Parameters
    ----------
    W : (rows, p)
        Regressor, or a triangular factor of it.
    parameters : sequence of Parameter
        Of the p columns.
    preference : sequence of int, optional
        Columns in the order in which they should be kept; by default as they come.
    """
    preference = list(range(W.shape[1])) if preference is None else list(preference)
    if W.shape[0] > W.shape[1]:
        W = triangular_factor(W)
    length = np.linalg.norm(W, axis=0)
    used = length > 1e-12 * max(length.max(initial=0.0), 1e-300)
    scaled = np.where(used, W / np.where(used, length, 1.0), 0.0)
    s = np.linalg.svd(scaled[:, used], compute_uv=False) if used.any() else np.empty(0)
    rank = int((s > RANK_TOLERANCE * s[0]).sum()) if len(s) else 0
    kept = scan_columns(scaled, [k for k in preference if used[k]])
    G = np.zeros((len(kept), W.shape[1]))
    if kept:
        # Solved for scaled columns, so that units do not decide which digits survive.
        solved = np.linalg.lstsq(scaled[:, kept], scaled, rcond=None)[0]
        G = solved * length[None, :] / length[kept, None]
        G[:, kept] = np.eye(len(kept))
        G[:, ~used] = 0.0
        G[np.abs(solved) < SPAN_TOLERANCE] = 0.0
    return BaseParameters(
        tuple(parameters), np.array(kept, int), G, s, rank != len(kept), tuple(preference)
    )


def random_motion(robot: Robot, rng: np.random.Generator, count: int = 400) -> Motion:
    """Return random states of a robot within its limits, loops closed.

    Positions are uniform within the limits (or ± 1.5 rad and ± 0.1 m about home where there are
    none), velocities and accelerations standard normal.
    """
    home = robot.actuated_positions(robot.home[None])[0]
    reach = np.array([0.1 if robot.is_prismatic(int(k)) else 1.5 for k in robot.actuated])
    if robot.base is not None:  # its equations hold in its own axes
        reach[: len(robot.joints) - len(robot.motor_joints)] = 0.0
    low, high = robot.limits.T
    low = np.where(np.isfinite(low), low, home - reach)
    high = np.where(np.isfinite(high), high, home + reach)
    n = len(home)
    q = rng.uniform(low, high, (count, n))
    dq, ddq = rng.standard_normal((2, count, n))
    return complete_motion(robot, np.arange(count, dtype=float), q, dq, ddq)


@checked
def find_base_parameters(
    robot: KnownRobot,
    model: Annotated[Model, Expected("a Model, such as Model.of('rigid_body')")],
    rng: Rng | None = None,
) -> BaseParameters:
    """Return the base parameters that the structure of a robot allows, from random states.

    No motion can determine more; a measured motion may determine less.
    """
    rng = rng or np.random.default_rng(0)
    parameters = model.parameters(robot)
    count = max(100, 4 * len(parameters) // len(robot.actuated))
    W = model.regressor(robot, random_motion(robot, rng, count))
    names = tuple(p.name for p in parameters)
    return group_columns(W.reshape(-1, W.shape[2]), parameters, robot.column_preference(names))
