"""KUKA LWR4+: how well does a model that was fitted to one run predict another?

Three runs of the real arm with its link-side torque sensors (200 Hz, 25 s; source and licence are
in the folder of the data). Runs 1 and 2 follow the same motion, and run 3 another that is about
twice as fast. So 1 → 2 tests repeatability, 3 → 1 interpolation and 1 → 3 extrapolation. The known
relative errors of rigid body + viscous + Coulomb friction + offset are 1.7 %, 7 % and 13-15 %; for
1 → 3 friction and offsets bring 36.8 % to 13.0 %.

The known figures are ‖τ̂ - τ‖/‖τ‖ (`relative` below). ε_RA of the paper's Eq. 18 on the same
predictions is 1.1 to 1.6 times as large, because the small joints count for more in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from real_data import FOLDER
from shared import data_folder, study_parser

from identifiability.estimation.estimate import Method, estimate_noise, find_estimator
from identifiability.estimation.prediction import Prediction, predict
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.quality.hints import weigh_rows
from identifiability.regression.information import gather_information
from identifiability.regression.reduction import Submodel, build_ladder, ladder_model, read_ladder
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis, analyze

#: Known relative errors [%], lowest and highest: (model, fitted to, validated on).
KNOWN = {
    ("with friction and offsets", 1, 2): (1.7, 1.7),
    ("with friction and offsets", 1, 3): (13.0, 15.0),
    ("with friction and offsets", 3, 1): (7.0, 7.0),
    ("with rotor inertia", 3, 1): (7.7, 7.7),
    ("rigid body alone", 1, 3): (36.8, 36.8),
}

#: The runs of the data.
RUNS = (1, 2, 3)

#: The models to compare.
LADDER = FOLDER / "kuka_lwr4_ladder.toml"

#: Samples to skip, as the authors of the data do.
START = 500

#: From here on positions and velocities of every run contradict each other: the low-pass that
#: the positions went through before they were stored ran out of samples.
END = 4900

#: Name → (velocities and accelerations of the file?, last sample, preparation).
PROCESSINGS = {
    "ours": (False, END, Preparation()),
    "the file's": (True, END, Preparation()),
    "the file's, filtered in parallel": (True, END, Preparation(decimate=20)),
    "ours, whole file": (False, None, Preparation()),
    "the file's, whole file": (True, None, Preparation()),
}


def load_robot(data: Path) -> Robot:
    """Return the arm."""
    return Robot.load(data / "kuka_lwr4.urdf", FOLDER / "kuka_lwr4.toml")


def read_run(data: Path, run: int) -> dict[str, np.ndarray]:
    """Return the arrays of a run, (N,) or (N, 7)."""
    with np.load(data / f"measurements_{run}.npz") as file:
        return {name: file[name] for name in file.files}


def load_log(
    data: Path, robot: Robot, run: int, *, derivatives: bool = False, end: int | None = END
) -> Log:
    """Return a run as a log, with the file's velocities and accelerations if asked for."""
    raw = {name: x[START:end] for name, x in read_run(data, run).items()}
    columns = {"t": raw["times"] - raw["times"][0]}
    channels = {"q": "positions", "tau": "torques"}
    if derivatives:
        channels |= {"dq": "velocities", "ddq": "accelerations"}
    for k, joint in enumerate(robot.joints):
        columns |= {f"{joint}.{kind}": raw[name][:, k] for kind, name in channels.items()}
    return Log.from_frame(pd.DataFrame(columns), f"run {run}")


def describe_run(data: Path, run: int) -> dict[str, float]:
    """Return the clock jitter, and the difference of velocities from slopes of positions.

    Returns
    -------
    dict
        ``jitter`` as a share of the sampling step; ``mismatch`` before and ``tail_mismatch``
        after `END`, as a share of the largest speed; the file's ``lag`` in samples.
    """
    raw = read_run(data, run)
    steps = np.diff(raw["times"])
    step = float(np.median(steps))
    slope, dq = np.gradient(raw["positions"], step, axis=0), raw["velocities"]
    wrong = np.abs(slope - dq).max(1) / np.abs(dq).max()
    body = slice(START, END)
    change = np.gradient(dq, axis=0)[body]
    lag = float(np.sum((slope - dq)[body] * change) / np.sum(change**2))
    return {
        "run": run,
        "step": step,
        "jitter": float(np.abs(steps - step).max() / step),
        "mismatch": float(wrong[body].max()),
        "tail_mismatch": float(wrong[END:].max()),
        "lag": lag,
    }


@dataclass(frozen=True)
class Fit:
    """Models of the ladder fitted to one run, and their prediction of the two others.

    Attributes
    ----------
    models : tuple of Submodel
    held_out : Prediction
    determined : tuple of bool
        Whether the run determines every parameter of a model.
    """

    models: tuple[Submodel, ...]
    held_out: Prediction
    determined: tuple[bool, ...]


def run_analysis(data: Path, train: int, method: Method, runs: Sequence[int] = RUNS) -> Analysis:
    """Return the analysis of one run, validated on the others, as any user would get it."""
    robot = load_robot(data)
    others = [load_log(data, robot, run) for run in others_than(train, runs)]
    return analyze(robot, load_log(data, robot, train), others, LADDER, method=method)


def fit(
    data: Path,
    robot: Robot,
    train: int,
    processing: str,
    method: Method,
    *,
    weigh: bool = False,
    runs: Sequence[int] = RUNS,
) -> Fit:
    """Fit to one run, stage by stage, so that the log can be treated in other ways.

    Published fits count all rows of a joint alike; `weigh` counts them as `analyze` does, outlying
    stretches less.
    """
    derivatives, end, preparation = PROCESSINGS[processing]
    every = (train, *others_than(train, runs))
    logs = [load_log(data, robot, run, derivatives=derivatives, end=end) for run in every]
    how = choose_cutoff(robot, logs[:1], preparation)  # as `analyze` does
    fitted, *others = (prepare_log(robot, log, how) for log in logs)
    entry = read_ladder(LADDER)
    structure = Structure.of(robot, ladder_model(entry))
    submodels = build_ladder(entry, structure)
    information = gather_information(structure.regression([fitted]))
    if weigh:
        base = find_estimator(method)
        information, *_ = weigh_rows(robot.joints, [fitted], information, base)
    estimator = estimate_noise(find_estimator(method), information)
    found = [estimator.fit(submodel.reduce(information)) for submodel in submodels]
    values = np.stack([r.expand(e.value) for r, e in zip(submodels, found, strict=True)], 1)
    held_out = predict(structure.regression(others), values)
    return Fit(submodels, held_out, tuple(bool(e.determined.all()) for e in found))


def others_than(train: int, runs: Sequence[int] = RUNS) -> list[int]:
    """Return the runs that a model fitted to one is validated on."""
    return [run for run in runs if run != train]


def held_out_errors(prediction: Prediction, log: int, model: int) -> dict[str, float]:
    """Return the readings of "relative error" of a model on one held-out log [%].

    ``relative`` is ‖τ̂ - τ‖/‖τ‖ over all joints, ``epsilon_ra`` Eq. 18 of the paper (sums of
    absolute values, spread about the mean of all joints). ``epsilon_ra_joints`` is the same about
    each joint's own mean, and ``worst_joint`` is that of the worst joint by itself.
    """
    rows = prediction.log == log
    tau, residual = prediction.tau[rows], prediction.residual[rows, :, model]
    size, about = np.abs(residual), np.abs(tau - tau.mean(0))
    values = {
        "relative": np.linalg.norm(residual) / np.linalg.norm(tau),
        "epsilon_ra": size.sum() / np.abs(tau - tau.mean()).sum(),
        "epsilon_ra_joints": size.sum() / about.sum(),
        "worst_joint": (size.sum(0) / about.sum(0)).max(),
    }
    return {name: 100 * float(value) for name, value in values.items()}


def table_rows(
    fit: Fit, train: int, runs: Sequence[int] = RUNS, **labels: str
) -> Iterator[dict[str, Any]]:
    """Yield one row a held-out run and model."""
    for log, run in enumerate(others_than(train, runs)):
        for k, submodel in enumerate(fit.models):
            yield {
                "train": train,
                "validate": run,
                "model": submodel.name,
                "parameters": len(submodel),
                **labels,
                "known": KNOWN.get((submodel.name, train, run)),
                **held_out_errors(fit.held_out, log, k),
            }


def compare(
    data: Path, processings: Sequence[str], methods: Sequence[Method], runs: Sequence[int] = RUNS
) -> pd.DataFrame:
    """Return the held-out errors of every run, way of processing and method."""
    robot = load_robot(data)
    rows: list[dict[str, Any]] = []
    for processing in processings:
        for method in methods:
            for train in runs:
                found = fit(data, robot, train, processing, method, runs=runs)
                rows += table_rows(found, train, runs, derivatives=processing, method=method)
    return pd.DataFrame(rows)


def print_table(frame: pd.DataFrame) -> None:
    """Print the rows whose error is known and ours, with the methods side by side."""
    methods = list(frame["method"].unique())
    names = "".join(f"{m.upper():>6s}" for m in methods)
    print(f"{'':65s}known{'relative':>{6 * len(methods) + 3}s}{'ε_RA':>{6 * len(methods) - 2}s}")
    print(f"{'':34s}{'derivatives':32s}   [%]{names} {names}")
    by = ["model", "train", "validate", "derivatives"]
    for key, rows in frame[frame["known"].notna()].groupby(by, sort=False):
        model, train, validate, derivatives = key
        low, high = rows["known"].iloc[0]
        known = f"{low:g}" if low == high else f"{low:g}-{high:g}"
        relative, epsilon = (
            "".join(f"{x:6.1f}" for x in rows[kind]) for kind in ("relative", "epsilon_ra")
        )
        print(f"{train} → {validate} {model:27s} {derivatives:32s}{known:>6s}{relative} {epsilon}")


def print_runs(runs: Sequence[dict[str, float]]) -> None:
    """Print the data-quality problems of the files."""
    for run in runs:
        print(
            f"run {run['run']}: the clock jitters by {100 * run['jitter']:.0f} % of a step; "
            f"velocities lag the slope of the positions by {run['lag']:.1f} samples and differ "
            f"from it by {100 * run['mismatch']:.1f} %, after sample {END} by "
            f"{100 * run['tail_mismatch']:.0f} %"
        )


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the study, print its table and write its files."""
    parser = study_parser("kuka_lwr4", __doc__, "one way, runs 1 and 3")
    parser.add_argument("--data", help="folder of the data sets")
    arguments = parser.parse_args(argv)
    data, used = data_folder("kuka_lwr4", arguments.data), RUNS
    if arguments.quick:
        used = (1, 3)
        frame = compare(data, ["ours"], ["wls"], used)
    else:
        frame = compare(data, list(PROCESSINGS), ["ols", "wls"])
    runs = [describe_run(data, run) for run in used]
    print_runs(runs)
    print_table(frame)
    result = {"study": "kuka_lwr4", "runs": runs, "errors": frame.to_dict("records")}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    print(f"\n{write_json(arguments.out, result)}")
    print(run_analysis(data, 1, "wls", used).write_report(arguments.out.with_suffix(".html")))
    return frame


if __name__ == "__main__":
    main()
