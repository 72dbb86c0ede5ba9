"""Is the robot that comes out the one that was fitted, in simulators, and read back?

Every shipped robot (simulated logs, the paper's noise) and three real ones are fitted to one log
and exported in both formats. On motion that was not fitted, errors must be the same
on roads that share nothing with the library but the file: what a file holds by itself in MuJoCo and
in Pinocchio (loops closed by the library, as neither reads a sidecar), and all that was fitted by
file and sidecar. Then MuJoCo runs the exported MJCF forward for two
seconds, driven by the measured torque and a PD. Nothing is set by hand.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from exported.cases import Case, every_case
from exported.drive import Driven, drive
from exported.roads import in_mujoco, in_pinocchio, project
from real_data.study import ROOT

from identifiability.effects.registry import default_effects
from identifiability.effects.vocabulary import every_parameter, values_in_file
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import write_json
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.physical.cad_prior import is_far, mass_rows
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.regression.regression import Model
from identifiability.report import Check, Section, frame_table, write_page
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.export import Exported, export

#: Errors are the same if they differ by less than this share of themselves.
SAME = 0.02

#: A simulation is stable if no joint leaves the logged motion by more than it moves in it.
NEAR = 1.0

#: A road from a motion to torque, (N, n); None where it has no word for something.
Road = Callable[[Motion], "np.ndarray | None"]


def fit(case: Case) -> Analysis:
    """Fit the whole model to the first log."""
    effects = [*default_effects(case.robot, case.effects)]
    ladder = LadderEntry(models=[ModelEntry(name="whole", effects=effects)])
    return analyze(case.robot, case.fitted, ladder=ladder, replicates=0)


def unseen_samples(case: Case, result: Analysis) -> Samples:
    """Prepare the log that was not fitted as the fitted one was."""
    how = settle_cutoff(case.robot, (case.unseen,), result.fit.preparation)
    samples = prepare_log(case.robot, case.unseen, how, engine=Serial())
    assert isinstance(samples, Samples)
    return samples


def error_on(samples: Samples, road: Road) -> float:
    """Return ε_RA of a road to torque along samples; nan where it has no word for something."""
    measured, found = [], []
    for piece in samples.pieces(4096):
        tau = road(piece.motion)
        if tau is None:
            return float("nan")
        measured.append(piece.down(piece.tau))
        found.append(piece.down(tau))
    tau, predicted = np.concatenate(measured), np.concatenate(found)
    return float(np.abs(predicted - tau).sum() / np.abs(tau - tau.mean(0)).sum())


def by_values(robot: Robot, model: Model, values: dict[str, float]) -> Road:
    """Return the road of the regressor with standard parameters."""
    names = [p.name for p in model.parameters(robot)]
    first = np.array([names.index(n) == k for k, n in enumerate(names)])
    phi = np.array([values.get(n, 0.0) for n in names]) * first
    return lambda motion: model.regressor(robot, motion) @ phi


def moved_as(robot: Robot, motion: Motion) -> Motion:
    """Return a motion in the order of the joints of a robot that was read from another file."""
    actuated = (motion.actuated_q, motion.actuated_v, motion.actuated_a)
    return complete_motion(robot, motion.t, *actuated)


def by_engine(engine: Callable[..., Any], exported: Exported, robot: Robot) -> Road:
    """Return the road of another engine that reads the file alone."""

    def road(motion: Motion) -> np.ndarray | None:
        own = moved_as(robot, motion)
        tree = engine(exported.robot, robot, own)
        return None if tree is None else project(robot, own, tree)

    return road


def both_formats(case: Case, path: Path, folder: Path) -> list[Exported]:
    """Export in the robot's own format, and in the other one where that can hold it."""
    own, other = (".xml", ".urdf") if case.robot.mjcf else (".urdf", ".xml")
    out = [export(case.robot, path, folder / f"own{own}")]
    try:
        out.append(export(case.robot, path, folder / f"other{other}"))
    except IdentifiabilityError as error:
        print(f"  {error}")
    return out


def read_again(exported: Exported, values: dict[str, float], shapes: dict[str, float]) -> Road:
    """Return the road of an exported pair that is loaded as any robot is."""
    copy = Robot.load(exported.robot)
    known = every_parameter(copy, shapes)
    model = Model.of(*dict.fromkeys(known[name].group for name in values if name in known))
    torque = by_values(copy, model, dict(copy.nominal))
    return lambda motion: torque(moved_as(copy, motion))


def study_case(case: Case, folder: Path) -> dict[str, Any]:
    """Return what file, and all that was fitted, err by on each road, and what else is to show."""
    start = time.process_time()
    result = fit(case)
    samples = unseen_samples(case, result)
    path = result.to_json(folder / "result.json")
    values = result.chosen.physical.parameters()
    model = Model.of(*result.effects)
    row: dict[str, Any] = {"robot": case.name}
    row["fitted"] = error_on(samples, by_values(case.robot, model, values))
    driven = Driven(finite=False, away=float("nan"), open=float("nan"))
    for exported in both_formats(case, path, folder):
        copy = Robot.load(exported.robot)
        form = "MJCF" if copy.mjcf else "URDF"
        held = by_values(case.robot, model, values_in_file(copy, values))
        row[f"{form} alone"] = error_on(samples, held)
        for name, engine in (("MuJoCo", in_mujoco), ("Pinocchio", in_pinocchio)):
            row[f"{form}, {name}"] = error_on(samples, by_engine(engine, exported, copy))
        row[f"{form}, sidecar"] = error_on(samples, read_again(exported, values, result.shapes))
        if copy.mjcf:
            driven = drive(exported.robot, copy, moved_as(copy, samples.motion), samples.tau)
    masses = mass_rows(case.robot, values)
    far = [m for m in masses if is_far(m["mass"], m["mass_file"])]
    row["mass"] = sum(m["mass"] for m in masses)
    row["mass of the file"] = sum(m["mass_file"] for m in masses)
    row["far"] = ", ".join(f"{m['body']} {m['mass']:.3g} for {m['mass_file']:.3g}" for m in far)
    row |= {"runs": driven.finite, "away": driven.away, "open": driven.open}
    row["cad_prior"] = result.chosen.physical.cad_weight
    row["seconds"] = time.process_time() - start
    return row


def differences(row: dict[str, Any]) -> dict[str, float]:
    """Return how far roads that should agree differ, as shares of the error."""
    out = {}
    for form in ("MJCF", "URDF"):
        pairs = [(f"{form}, {engine}", f"{form} alone") for engine in ("MuJoCo", "Pinocchio")]
        pairs += [(f"{form}, sidecar", "fitted")]
        out |= {a: abs(row[a] / row[b] - 1) for a, b in pairs if a in row}
    return out


def table(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return what is to show, a row a robot."""
    out = []
    for row in rows:
        differ = differences(row)
        files = [v for k, v in differ.items() if "MuJoCo" in k or "Pinocchio" in k]
        pairs = [v for k, v in differ.items() if "sidecar" in k]
        out.append(
            {
                "robot": row["robot"],
                "error of all that was fitted": row["fitted"],
                "of the MJCF alone": row.get("MJCF alone", np.nan),
                "of the URDF alone": row.get("URDF alone", np.nan),
                "files in simulators differ by": float(np.nanmax(files)),
                "sidecar differs by": float(np.nanmax(pairs)),
                "same": _check(np.nanmax([*files, *pairs]) < SAME),
                "mass [kg]": row["mass"],
                "of the file [kg]": row["mass of the file"],
                "beyond a factor 3": row["far"],
                "leaves the motion by": row["away"],
                "stable": _check(row["runs"] and row["away"] < NEAR),
            }
        )
    return pd.DataFrame(out)


def _check(passed: Any) -> Check:
    return Check("yes" if passed else "no", bool(passed))


def main(argv: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Run the study, print its table and write its files."""
    parser = argparse.ArgumentParser(prog="exported_robot", description=str(__doc__))
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "exported_robot.json")
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    parser.add_argument("--robots", nargs="*", default=(), help="some of them, by name")
    given = parser.parse_args(argv)
    rows = []
    for case in every_case(given.data, tuple(given.robots)):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(study_case(case, Path(folder)))
        print({k: round(v, 5) if isinstance(v, float) else v for k, v in rows[-1].items()})
    frame = table(rows)
    same, stable = (sum(bool(c.passed) for c in frame[k]) for k in ("same", "stable"))
    text = (
        f"Of {len(rows)} robots {same} err by the same on all roads to {100 * SAME:g} %, and "
        f"{stable} stay by the logged motion for two seconds in MuJoCo."
    )
    print(text)
    lead = (
        "Errors are ε_RA on motion that was not fitted. A file alone has what simulators read; its "
        "error in MuJoCo and Pinocchio is set beside the library's, and that of file and sidecar "
        "read again, and of the generated Python, beside that of all that was fitted. Pinocchio "
        "has no word for springs and tendons, and is left out there."
    )
    section = Section("roads", "One robot, on every road", lead, (frame_table(frame),))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    told = {"schema": "identifiability/study/exported_robot/1", "statement": text, "robots": rows}
    print(write_json(given.out, told))
    page = given.out.with_suffix(".html")
    print(write_page("Is it the robot that was fitted?", text, (section,), page, overline="Study"))
    return rows


if __name__ == "__main__":
    main()
