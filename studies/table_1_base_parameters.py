"""Table 1: which 25 combinations of inertial parameters does the robot's structure determine?

Everything here is exact: ranks, groupings with their printed coefficients, the sizes and rows of
Models 1 to 4, and the CAD identities of Table 8. So are the recovery of exact parameters from exact
data, and the balance of power.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
from paper_study.command import Options, run_script
from paper_study.monte_carlo import as_samples, expand_fits, fit_models
from paper_study.printed import read_printed
from paper_study.result import (
    StudyCheck,
    StudyResult,
    StudyTable,
    check_equal,
    check_holds,
    check_range,
)
from paper_study.subject import TRAJECTORIES, Subject, exact_log, load_subject

from identifiability.foundation.rounding import format_number
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Model
from identifiability.regression.structure import BaseParameters, find_base_parameters
from identifiability.report import check_cell
from identifiability.robot import complete_motion
from identifiability.simulation import MujocoRobot, shipped_trajectory


def printed_digits(value: float) -> float:
    """Round as the paper prints: four significant digits."""
    return float(f"{value:.4g}")


def groupings(base: BaseParameters) -> dict[str, dict[str, float]]:
    """Return the rounded coefficients of every group by its representative term."""
    return {
        base.terms(row)[0][1].term: {p.term: printed_digits(c) for c, p in base.terms(row)}
        for row in range(len(base))
    }


def find_group(base: BaseParameters, terms: dict[str, float]) -> dict[str, float] | None:
    """Return our group of a printed row: the one that has the same terms."""
    return next((g for g in groupings(base).values() if set(g) == set(terms)), None)


def compare_rows(base: BaseParameters, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return Table 1 with our groupings and the printed ones."""
    out = []
    labels = {base.terms(row)[0][1].term: base.label(row) for row in range(len(base))}
    for row in rows:
        found = find_group(base, row["terms"])
        equal = found == row["terms"]
        ours = labels[next(iter(found))] if found else "none"
        out.append(
            {
                "row": str(row["row"]),
                "paper": row["printed"],
                "in models": ", ".join(map(str, row["models"])),
                "ours": ours,
                "result": check_cell(
                    "pass" if equal else "differs",
                    passed=equal,
                    reason="" if equal else "not the printed digits",
                ),
            }
        )
    return pd.DataFrame(out)


def rows_used(subject: Subject, submodel: Submodel, rows: list[dict[str, Any]]) -> tuple[int, ...]:
    """Return the rows of Table 1 that a model has, tied ones included."""
    used = {
        subject.base.parameters[k].term for k in subject.base.kept[np.abs(submodel.M).sum(1) > 0]
    }
    return tuple(r["row"] for r in rows if used & {t for t, c in r["terms"].items() if c == 1})


def structure_checks(
    subject: Subject, rigid: BaseParameters, rows: list[dict[str, Any]], right: int
) -> list[StudyCheck]:
    """Check ranks, groupings, sizes and rows."""
    base = subject.base
    coefficients = {abs(c) for r in rows for c in r["terms"].values()} - {1}
    found = {abs(c) for g in groupings(rigid).values() for c in g.values()} - {1}
    gaps = ", ".join(
        f"{format_number(b.gap[0], 2)} / {format_number(b.gap[1], 1)}" for b in (rigid, base)
    )
    kept = {p.name for p in (rigid.parameters[k] for k in rigid.kept)}
    lost = {"leg1_upper.m", "platform.m", "platform.my"} & kept
    out = [
        check_equal("rank of the 70 rigid-body columns", rigid.rank, 25),
        check_equal("rank of the 85 columns of the complete model", base.rank, 37),
        check_holds(
            "gap of the singular values (last kept / first dropped)",
            gaps,
            min(rigid.gap[0], base.gap[0]) > 3e-4 and max(rigid.gap[1], base.gap[1]) < 1e-12,
            "> 3·10⁻⁴ / < 10⁻¹²",
        ),
        check_equal("groupings with every printed coefficient", f"{right} of 25", "25 of 25"),
        check_equal("coefficients of Table 1", sorted(found), sorted(coefficients)),
        check_equal("point-mass columns m(2), m(3), my(3) are eliminated", sorted(lost), []),
        check_equal("sizes of Models 1 to 4", [len(r) for r in subject.models], [37, 24, 18, 12]),
    ]
    for k, submodel in enumerate(subject.models):
        # Model 3 adds the columns of equal legs: rows 15, 16, 19, 21, 22, 25 stay, tied.
        model = 2 if k == 2 else k + 1
        wanted = tuple(r["row"] for r in rows if model in r["models"])
        out.append(
            check_equal(
                f"rows of Table 1 in {submodel.name}", rows_used(subject, submodel, rows), wanted
            )
        )
    single = [c for c in subject.models[2].columns if not c.startswith("slider")]
    out.append(check_equal("rigid-body parameters of Model 3", len(single), 9))
    return out


def cad_checks(subject: Subject) -> list[StudyCheck]:
    """Check the CAD column of Table 8 against the robot file."""
    names = dict(zip(subject.base.names, subject.structure.nominal_base, strict=True))
    return [
        check_range(
            f"CAD value of {row['printed']}",
            names[row["name"]],
            row["cad"] - 0.005,
            row["cad"] + 0.005,
            unit=row["unit"],
            printed=row["cad"],
        )
        for row in read_printed("table_8")["rows"]
    ]


def recovery_checks(subject: Subject, robot: str) -> list[StudyCheck]:
    """Fit exact data: Models 1 to 3 must find the exact parameters, Model 4 is a truncation."""
    worst = np.zeros((len(TRAJECTORIES), len(subject.models)))
    for k, name in enumerate(TRAJECTORIES):
        log = exact_log(robot, name, 750)
        motion = complete_motion(subject.robot, log.t, log.q, log.dq, log.ddq)
        _, _, fits = fit_models(subject, [as_samples(name, motion, log.tau)])
        values = expand_fits(subject, fits)
        truth = subject.structure.nominal_base
        worst[k] = np.abs(values - truth[:, None]).max(0) / np.abs(truth).max()
        exact = subject.exact[3]
        worst[k, 3] = np.abs(fits[3].value / exact - 1).max()
    out = [
        check_range(
            f"{subject.models[m].name} recovers exact parameters from exact data "
            "(worst error, share of the largest)",
            worst[:, m],
            0,
            1e-9,
        )
        for m in range(3)
    ]
    truncated = check_range(
        "Model 4 does not quite: worst parameter", 100 * worst[:, 3], 0.01, 5, unit="%"
    )
    return [*out, truncated]


def power_check(subject: Subject, step: float = 1e-4) -> StudyCheck:
    """Check τ·q̇ = dE/dt along a trajectory, torque by the simulator and energy by Pinocchio."""
    robot = subject.robot
    trajectory = shipped_trajectory(robot, "601")
    t = np.linspace(0.1, 7.4, 60)
    torque = MujocoRobot(robot).inverse_dynamics(*trajectory.motion(t)).tau
    power = np.einsum("ij,ij->i", torque, trajectory.motion(t)[1])
    model = robot.model.copy()
    model.armature[:] = 0.0  # the simulator's torque is that of the rigid bodies alone
    data = model.createData()

    def energy(at: np.ndarray) -> np.ndarray:
        motion = complete_motion(robot, at, *trajectory.motion(at))
        pairs = zip(motion.q, motion.v, strict=True)
        return np.array(
            [
                pin.computeKineticEnergy(model, data, q, v)
                + pin.computePotentialEnergy(model, data, q)
                for q, v in pairs
            ]
        )

    rate = (energy(t + step) - energy(t - step)) / (2 * step)
    off = np.abs(power - rate).max() / np.abs(power).max()
    return check_range("balance of power, worst |τ·q̇ − dE/dt| / largest", off, 0, 1e-5)


def run(options: Options) -> StudyResult:
    """Compare the structure of the robot file with Table 1."""
    subject = load_subject(options.robot)
    rows = read_printed("table_1")["rows"]
    rigid = find_base_parameters(subject.robot, Model.of("rigid_body"))
    table = compare_rows(rigid, rows)
    right = sum(check.badge == "pass" for check in table["result"])
    checks = structure_checks(subject, rigid, rows, right)
    options.say("exact recovery", 0.3)
    checks += [*cad_checks(subject), *recovery_checks(subject, options.robot)]
    checks.append(power_check(subject))
    return StudyResult(
        "table_1_base_parameters",
        "Table 1: base parameters",
        "Which combinations of inertial parameters does the robot's structure determine?",
        f"{right} of the paper's 25 groupings come out of the robot file with every printed "
        f"coefficient; the rank is {rigid.rank}, that of the complete model {subject.base.rank}.",
        tuple(checks),
        (StudyTable("Rows of Table 1, the paper's and ours", table),),
        method=(
            "Ranks come from the column-scaled singular values at random states of the closed "
            "mechanism. A column represents a group if it does not lie in the span of those "
            "before it, in the order that the robot file states.",
            "Exact data come from the simulator, which shares no code with the regressor.",
        ),
    )


if __name__ == "__main__":
    run_script(run)
