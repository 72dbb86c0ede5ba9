"""Stäubli TX40: do we find the base parameters that were published for these very data?

One run of the real arm (motor positions and torques, 5 kHz, 9 s; source and licence are in the
folder of the data), whose motor 6 drives joints 5 and 6. The published values come with standard
deviations, and the way they were computed is public too, so we can ask twice: what do we find from
the same log in our own way, and do we find the same if we treat the log as they did?
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from real_data import FOLDER
from scipy import signal
from shared import data_folder, study_parser

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.prediction import predict
from identifiability.foundation.linalg import scan_columns
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_json
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.information import gather_information
from identifiability.regression.reduction import ladder_model, read_ladder
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import BaseParameters
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.analyze import Analysis, analyze

#: The model of the published parameters.
LADDER = FOLDER / "staubli_tx40_ladder.toml"

#: Sampling step [s].
STEP = 0.0002

#: Published parameters named by the task, with the value in its words.
WELL_KNOWN = {"fv1": 8.1, "Ia4": 0.030, "fvm6": 0.616}

#: Ways to treat the log with this library.
PROCESSINGS = {
    "ours": Preparation(),
    "ours, decimated as published": Preparation(cutoff=25, decimate=100),
    "ours, standstill kept": Preparation(keep_rest=True),
}

#: Joint speeds below which a row is left out in the published treatment [rad/s].
SLOW = np.array([0.05009095, 0.05009095, 0.07504916, 0.0715585, 0.05585054, 0.12217305])

#: Cut-off of the published low-pass [Hz]. Its configuration says 100 Hz but normalises it by
#: twice the sampling rate instead of half of it.
PUBLISHED_CUTOFF = 25.0

_TERM = re.compile(r"([+-]?)\s*(?:([\d.]+)\*)?([A-Za-z]+)(\d)")
_KINDS = {"Ia": "Ia", "fv": "Fv", "fs": "Fc", "off": "off", "Iam": "Ia", "fvm": "Fv", "fsm": "Fc"}


@dataclass(frozen=True)
class Fit:
    """Base parameters fitted in some way.

    Attributes
    ----------
    value : (b,)
    covariance : (b, b)
        Under white noise.
    rank : int
        Base parameters that the data determine.
    relative_error : float
        ‖τ̂ - τ‖/‖τ‖ over the rows of the fit.
    """

    value: Array
    covariance: Array
    rank: int
    relative_error: float


def load_robot(data: Path) -> Robot:
    """Return the arm with its coupled wrist."""
    return Robot.load(data / "tx40_mdh_modified.urdf", FOLDER / "staubli_tx40.toml")


def load_log(data: Path, robot: Robot, share: float = 1.0) -> Log:
    """Return the run as a log of the motors, or the first share of it."""
    assert robot.transmission is not None
    q = pd.read_csv(data / "pos_read_data.csv").to_numpy()
    tau = pd.read_csv(data / "curr_data.csv").to_numpy()
    q, tau = (x[: int(share * len(q))] for x in (q, tau))
    columns = {"t": STEP * np.arange(len(q))}
    for k, motor in enumerate(robot.transmission.motors):
        columns |= {f"{motor}.q": q[:, k], f"{motor}.tau": tau[:, k]}
    return Log.from_frame(pd.DataFrame(columns), "TX40")


def read_published(data: Path) -> pd.DataFrame:
    """Return expression, values and σ% of the published base parameters."""
    names = ["expression", "ols", "ols_sigma_percent", "wls", "wls_sigma_percent"]
    return pd.read_csv(data / "TX40_bp_5.csv", header=None, names=names)


def parse_grouping(expression: str) -> dict[str, float]:
    """Return a published grouping as coefficients of our standard parameters.

    Published columns of motor 6 act crosswise (q̇₆ on joint 5, q̇₅ on joint 6) where ours act with
    q̇₅ + q̇₆ on both. The torque is the same if the published fv5 and fv6 are our ``joint_5.Fv`` and
    ``joint_6.Fv`` plus ``motor_6.Fv``; rotor inertias likewise. Coulomb columns are the same.
    """
    out: dict[str, float] = {}
    for sign, size, kind, index in _TERM.findall(expression):
        coefficient = float(size or 1) * (-1 if sign == "-" else 1)
        ours = _KINDS.get(kind, kind)
        if kind.endswith("m") and kind in _KINDS:
            owner = f"motor_{index}"
        else:
            owner = f"joint_{index}" if kind in _KINDS else f"link_{index}"
        out[f"{owner}.{ours}"] = coefficient
        if ours in ("Ia", "Fv") and owner in ("joint_5", "joint_6"):
            out[f"motor_6.{ours}"] = coefficient
    return out


def published_in_ours(base: BaseParameters, expressions: Sequence[str]) -> tuple[Array, Array]:
    """Return T (60, b) with ``published = T beta``, and the distance from our row space (60,).

    A published grouping is a row g over the standard parameters. If ``g = T G`` with our groupings
    G, it means the same in both spellings, and T is g on our representatives.
    """
    at = {p.name: k for k, p in enumerate(base.parameters)}
    g = np.zeros((len(expressions), len(at)))
    for row, expression in enumerate(expressions):
        for name, coefficient in parse_grouping(expression).items():
            g[row, at[name]] = coefficient
    T = g[:, base.kept]
    return T, np.abs(g - T @ base.G).max(1)


def run_analysis(data: Path, method: Method, share: float = 1.0) -> Analysis:
    """Return the analysis of the log as any user would get it."""
    robot = load_robot(data)
    return analyze(robot, load_log(data, robot, share), ladder=LADDER, method=method)


def fit_ours(
    data: Path, base: BaseParameters, processing: str, method: Method, share: float = 1.0
) -> Fit:
    """Fit with this library, stage by stage, so that the log can be treated in other ways."""
    robot = load_robot(data)
    samples = prepare_log(robot, load_log(data, robot, share), PROCESSINGS[processing])
    regression = Regression(robot, ladder_model(read_ladder(LADDER)), (samples,), base.kept)
    found = estimate(gather_information(regression), method)
    prediction = predict(regression, found.value[:, None])
    error = float(np.linalg.norm(prediction.residual) / np.linalg.norm(prediction.tau))
    return Fit(found.value, found.covariance, len(found.kept), error)


def published_rows(
    robot: Robot,
    log: Log,
    model: Model,
    kept: np.ndarray,
    *,
    wrist: bool = False,
    dwells: np.ndarray | None = None,
) -> tuple[list[Array], list[Array]]:
    """Return regressor rows and torque of each joint after the published treatment.

    Zero-phase Butterworth low-pass of the positions, forward then central differences, decimation
    of every column by 100 (twice 10, Chebyshev), rows of slow joints left out. The published
    program leaves the acceleration of the last joint at zero; `wrist` computes it. With `dwells`
    (N, n) the rows are left out where this library says that the joint stands, not slow ones.
    """
    assert robot.transmission is not None
    q, tau = robot.transmission.joint_side(log.q, log.tau)
    edge = slice(20, -20)
    smooth = signals.lowpass(q, STEP, PUBLISHED_CUTOFF)[edge]
    dq = np.diff(smooth, axis=0) / STEP
    ddq = np.gradient(dq, STEP, axis=0)
    if not wrist:
        ddq[:, -1] = 0.0
    motion = complete_motion(robot, log.t[edge][:-1], smooth[:-1], dq, ddq)
    W = _decimate(model.regressor(robot, motion)[:, :, kept])
    tau, speed = _decimate(tau[edge][:-1]), _decimate(dq)
    taken = np.abs(speed) >= SLOW if dwells is None else ~dwells[edge][:-1][::100]
    rows = [taken[:, j] for j in range(len(SLOW))]
    joints = range(len(SLOW))
    return [W[rows[j], j] for j in joints], [tau[rows[j], j] for j in joints]


def _decimate(x: Array) -> Array:
    for _ in range(2):
        x = signal.decimate(x, 10, axis=0, zero_phase=True)
    return x


def fit_published(
    data: Path,
    base: BaseParameters,
    method: Method,
    *,
    wrist: bool = False,
    our_rows: bool = False,
) -> Fit:
    """Fit as published, by plain least squares that shares no code with the library's.

    With `our_rows` of those rows in which a joint moves by this library's rule: real friction is
    no straight line, so which slow rows count moves its line by more than its uncertainty.
    """
    robot, log = load_robot(data), load_log(data, load_robot(data))
    dwells = prepare_log(robot, log).weight == 0 if our_rows else None
    model = ladder_model(read_ladder(LADDER))
    blocks, torques = published_rows(robot, log, model, base.kept, wrist=wrist, dwells=dwells)
    W, tau = np.vstack(blocks), np.concatenate(torques)
    length = np.linalg.norm(W, axis=0)
    used = np.flatnonzero(length > 1e-9 * length.max())
    kept = used[scan_columns(np.linalg.qr(W[:, used] / length[used], mode="r"), range(len(used)))]
    beta, covariance, residual = _least_squares(W[:, kept], tau, np.ones(len(tau)))
    error = float(np.linalg.norm(residual) / np.linalg.norm(tau))
    if method == "wls":
        joint = np.repeat(np.arange(len(torques)), [len(t) for t in torques])
        spread = np.array([residual[joint == j].std() for j in range(len(torques))])
        beta, covariance, _ = _least_squares(W[:, kept], tau, 1 / spread[joint])
    value, full = np.zeros(len(base)), np.zeros((len(base), len(base)))
    value[kept], full[np.ix_(kept, kept)] = beta, covariance
    return Fit(value, full, len(kept), error)


def _least_squares(W: Array, tau: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Return estimate, covariance and unweighted residual."""
    A, b = W * weight[:, None], tau * weight
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    variance = np.sum((b - A @ x) ** 2) / (len(b) - len(x))
    return x, variance * np.linalg.inv(A.T @ A), tau - W @ x


def compare(base: BaseParameters, fit: Fit, published: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return every published base parameter with ours."""
    T, _ = published_in_ours(base, published["expression"].tolist())
    value = T @ fit.value
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", T, fit.covariance, T))
    theirs = published[method].to_numpy()
    percent = published[f"{method}_sigma_percent"].to_numpy()
    deviations = np.abs(value - theirs) / (np.abs(theirs) * percent / 100)
    return pd.DataFrame(
        {
            "expression": published["expression"],
            "name": [e.split(" ")[0] for e in published["expression"]],
            "published": theirs,
            "ours": value,
            "ratio": value / theirs,
            "published_sigma_percent": percent,
            "our_sigma_percent": 100 * sigma / np.abs(value),
            "deviation_in_sigma": deviations,
            "within_2_sigma": deviations < 2,
        }
    )


def print_table(table: pd.DataFrame) -> None:
    """Print the published parameters that are known to better than 15 %."""
    print(f"{'published parameter':24s}{'published':>10s}{'ours':>10s}  ratio     σ%  our σ%   2σ")
    for row in table[table["published_sigma_percent"] < 15].itertuples():
        more = " + …" if row.name != row.expression else ""
        print(
            f"{row.name + more:24s}{row.published:10.4f}{row.ours:10.4f}{row.ratio:7.3f}"
            f"{row.published_sigma_percent:7.1f}{row.our_sigma_percent:7.1f}"
            f"   {'yes' if row.within_2_sigma else 'no'}"
        )


def summarize(label: str, method: str, fit: Fit, table: pd.DataFrame) -> dict[str, Any]:
    """Print and return the comparison of one fit with the published values."""
    well = table[table["published_sigma_percent"] < 15]
    known = table.set_index("name")["ours"]
    result = {
        "processing": label,
        "method": method,
        "rank": fit.rank,
        "relative_error": fit.relative_error,
        "within_2_sigma": int(table["within_2_sigma"].sum()),
        "published": len(table),
        "largest_deviation_in_sigma": float(table["deviation_in_sigma"].max()),
        "largest_ratio_of_well_determined": float(np.exp(np.abs(np.log(well["ratio"])).max())),
        **{name: float(known[name]) for name in WELL_KNOWN},
    }
    print(
        f"{label:34s}{method}  rank {fit.rank}  error {100 * fit.relative_error:4.1f} %  within 2σ "
        f"{result['within_2_sigma']} of {len(table)}  "
        + "  ".join(f"{name} {known[name]:.4g} ({x:g})" for name, x in WELL_KNOWN.items())
    )
    return result


def fit_all(data: Path, base: BaseParameters, *, quick: bool) -> Iterator[tuple[str, Method, Fit]]:
    """Yield label, method and result of every way to fit the log."""
    methods: tuple[Method, ...] = ("ols", "wls")
    for processing in ("ours",) if quick else PROCESSINGS:
        for method in methods:
            share = 2 / 3 if quick else 1.0
            yield processing, method, fit_ours(data, base, processing, method, share)
    for wrist in () if quick else (False, True):
        label = "as published" + (", joint 6 accelerated" if wrist else "")
        for method in methods:
            yield label, method, fit_published(data, base, method, wrist=wrist)
    if not quick:
        for method in methods:
            fit = fit_published(data, base, method, wrist=True, our_rows=True)
            yield "as published, joint 6, our rows", method, fit


def main(argv: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Run the study, print its tables and write its files."""
    parser = study_parser("staubli_tx40", __doc__, "one way, the first two thirds of the log")
    parser.add_argument("--data", help="folder of the data sets")
    arguments = parser.parse_args(argv)
    data = data_folder("staubli_tx40", arguments.data)
    share, published = 2 / 3 if arguments.quick else 1.0, read_published(data)
    analysis = run_analysis(data, "wls", share)
    ours = fit_ours(data, analysis.base, "ours", "wls", share)
    print_table(compare(analysis.base, ours, published, "wls"))
    print()
    summaries, tables = [], {}
    for label, method, fit in fit_all(data, analysis.base, quick=arguments.quick):
        table = compare(analysis.base, fit, published, method)
        summaries.append(summarize(label, method, fit, table))
        tables[f"{label}, {method}"] = table.to_dict("records")
    result = {"study": "staubli_tx40", "fits": summaries, "parameters": tables}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    print(f"\n{write_json(arguments.out, result)}")
    print(analysis.write_report(arguments.out.with_suffix(".html")))
    return summaries


if __name__ == "__main__":
    main()
