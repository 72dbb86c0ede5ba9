"""Where does the printed text of the paper not hold literally, and what did we do about it?

A list, with the evidence that can be computed.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from paper_study.command import Options, run_script
from paper_study.printed import read_printed
from paper_study.result import (
    StudyCheck,
    StudyResult,
    StudyTable,
    check_equal,
    check_holds,
    check_range,
)
from paper_study.subject import STRIBECK, TRAJECTORIES, Subject, exact_log, load_subject

from identifiability.robot import complete_motion

#: Pitch of a ball screw that would fit, ours [m].
PITCH = 0.005


def condition_numbers(subject: Subject, robot: str) -> np.ndarray:
    """Return the condition number of the column-normalised rigid-body matrix of each trajectory."""
    out = []
    base = subject.base
    rigid = [k for k in base.kept if base.parameters[k].group == "rigid_body"]
    for name in TRAJECTORIES:
        log = exact_log(robot, name, 750)
        motion = complete_motion(subject.robot, log.t, log.q, log.dq, log.ddq)
        W = subject.model.regressor(subject.robot, motion)[:, :, rigid].reshape(-1, len(rigid))
        out.append(np.linalg.cond(W / np.linalg.norm(W, axis=0)))
    return np.array(out)


def equation_checks(subject: Subject, robot: str) -> list[StudyCheck]:
    """Show the effect of the printed equations."""
    logs = [exact_log(robot, name, 750) for name in TRAJECTORIES]
    shortest = min(float(log.q.min()) for log in logs)
    fastest = max(float(np.abs(log.dq).max()) for log in logs)
    largest = max(float(np.abs(log.tau).max()) for log in logs)
    static, velocity, shape = STRIBECK
    coulomb = subject.robot.nominal[f"{subject.robot.joints[0]}.Fc+"]
    literal = coulomb + (static - coulomb) * np.exp((fastest / velocity) ** shape)
    return [
        check_holds(
            "Eq. 10 literally: shortest leg, so Fc- never acts",
            f"{shortest:.3f} m",
            shortest > 0,
            "> 0",
        ),
        check_holds(
            "Eq. 20 literally: dry friction at the largest speed",
            f"{literal:.0f} N",
            literal > 2 * largest,
            f"> twice the largest force, {largest:.0f} N",
        ),
    ]


def number_checks(subject: Subject) -> list[StudyCheck]:
    """Show the inconsistencies of the printed numbers."""
    rows = {r["printed"]: r for r in read_printed("table_2")["rows"]}
    sd = [abs(rows[n]["identified"] * rows[n]["sigma_percent"]) / 100 for n in ("Fc+(1)", "Fc-(1)")]
    errors = [abs(r["identified"] / r["exact"] - 1) for r in rows.values()]
    zeros = int((subject.exact[0] == 0).sum())
    inertia = subject.robot.nominal[f"{subject.robot.joints[0]}.Jr"]
    inertia += subject.robot.nominal[f"{subject.robot.joints[0]}.Js"]
    return [
        check_range(
            "σ times estimate of Fc+ over that of Fc- in Table 2", sd[0] / sd[1], 0.99, 1.01
        ),
        check_equal("exact base parameters of Model 1 that are zero", zeros, 10),
        check_range(
            "ε_AV if only the six rows of Table 2 were wrong",
            100 * sum(errors) / 37,
            2600,
            2800,
            unit="%",
            paper="prints a far smaller mean of all",
        ),
        check_range(
            "actuator inertia with a pitch of 5 mm",
            1e4 * inertia * (PITCH / (2 * np.pi)) ** 2,
            3.05,
            3.07,
            unit="·10⁻⁴ kg m²",
        ),
    ]


def run(options: Options) -> StudyResult:
    """List the slips."""
    subject = load_subject(options.robot)
    slips = read_printed("slips")["slips"]
    conditions = condition_numbers(subject, options.robot)
    checks = equation_checks(subject, options.robot) + number_checks(subject)
    checks += [
        check_range(
            f"condition number of trajectory {name}",
            c,
            float(name) - 1,
            float(name) + 1,
            printed=float(name),
        )
        for name, c in zip(TRAJECTORIES, conditions, strict=True)
    ]
    frame = pd.DataFrame(
        {
            "where": [s["where"] for s in slips],
            "printed": [s["printed"] for s in slips],
            "why it does not hold": [s["problem"] for s in slips],
            "what we did": [s["done"] for s in slips],
        }
    )
    return StudyResult(
        "paper_slips",
        "Slips of the paper",
        "Where does the printed text not hold literally, and what did we do about it?",
        f"{len(slips)} places, each with what we did; what the paper concludes about "
        "identifiability stands.",
        tuple(checks),
        (StudyTable("Slips", frame),),
    )


if __name__ == "__main__":
    run_script(run)
