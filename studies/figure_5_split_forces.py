"""Figure 5: without actuator inertia, what does Model 1 make of rigid-body and friction forces?

Exact data of trajectory 601, Model 1 without the three inertias of rotor and screw. The sum fits;
its parts do not.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from paper_study.command import Options, run_script
from paper_study.drawing import draw_parts
from paper_study.monte_carlo import as_samples, fit_models, physically_possible
from paper_study.result import StudyCheck, StudyResult, StudyTable, check_holds, check_range
from paper_study.subject import ExactLog, Subject, exact_log, load_subject

from identifiability.foundation.names import Array
from identifiability.regression.reduction import Submodel
from identifiability.report import Gallery, Picture
from identifiability.robot import Motion, complete_motion

TRAJECTORY = "601"


def split_force(subject: Subject, motion: Motion, value: Array) -> tuple[Array, Array, Array]:
    """Return rigid-body, friction and actuator force of base parameters, each (N, n)."""
    W = subject.model.regressor(subject.robot, motion)[:, :, subject.base.kept]
    kinds = np.array([subject.base.parameters[k].group for k in subject.base.kept])
    body, motor = kinds == "rigid_body", kinds == "actuator_inertia"
    parts = [W[:, :, which] @ value[which] for which in (body, ~body & ~motor, motor)]
    return parts[0], parts[1], parts[2]


def fit_without(subject: Subject, log: ExactLog, motion: Motion) -> tuple[Array, bool]:
    """Return Model 1's base parameters without actuator inertia, and whether they are possible."""
    fitted = subject.without_actuators()
    submodel: Submodel = fitted.models[0]
    _, _, fits = fit_models(fitted, [as_samples(TRAJECTORY, motion, log.tau)])
    return submodel.expand(fits[0].value), physically_possible(submodel, fits[0].value)


def find_checks(
    tau: Array, exact: tuple[Array, ...], found: tuple[Array, ...], *, possible: bool
) -> list[StudyCheck]:
    """Return the checks of Figure 5."""
    total = sum(found)
    error = 100 * np.abs(total - tau).sum() / np.abs(tau - tau.mean()).sum()
    body = np.abs(found[0] - exact[0]).mean() / np.abs(exact[0]).mean()
    friction = np.abs(found[1] - exact[1]).mean() / np.abs(exact[1]).mean()
    return [
        check_range("ε_RA of the total", error, 0, 1.1, unit="%", paper="similar as a whole"),
        check_holds(
            "rigid-body part, mean error over mean size",
            f"{body:.2g} times",
            body > 3,
            "> 3 times",
            paper="unreasonable values",
        ),
        check_holds(
            "friction part, mean error over mean size",
            f"{friction:.2g} times",
            friction > 0.2,
            "> 0.2 times",
            paper="unreasonable values",
        ),
        check_holds(
            "Model 1 is physically impossible",
            "impossible" if not possible else "possible",
            not possible,
            "impossible",
            paper="non-physical meaning",
        ),
    ]


def run(options: Options) -> StudyResult:
    """Split the identified force into its parts."""
    subject = load_subject(options.robot)
    log = exact_log(options.robot, TRAJECTORY, 750)
    motion = complete_motion(subject.robot, log.t, log.q, log.dq, log.ddq)
    value, possible = fit_without(subject, log, motion)
    truth = split_force(subject, motion, subject.structure.nominal_base)
    found = split_force(subject, motion, value)
    checks = find_checks(log.tau, truth, found, possible=possible)
    figures = []
    for k, joint in enumerate(subject.robot.joints):
        parts = {
            "rigid body": found[0][:, k],
            "friction": found[1][:, k],
            "total": (found[0] + found[1])[:, k],
            "measured": log.tau[:, k],
        }
        figures.append(Picture(draw_parts(log.t, parts, f"{joint}: identified")))
        parts = {
            name: x[:, k]
            for name, x in zip(("rigid body", "friction", "actuator"), truth, strict=True)
        }
        figures.append(Picture(draw_parts(log.t, parts, f"{joint}: exact")))
    rows = []
    for name, exact, got in zip(
        ("rigid body", "friction", "actuator inertia"), truth, found, strict=True
    ):
        size = [float(np.sqrt(np.mean(x**2))) for x in (exact, got)]
        rows.append({"part": name, "exact, rms [N]": size[0], "identified, rms [N]": size[1]})
    return StudyResult(
        "figure_5_split_forces",
        "Figure 5: forces split",
        "Without actuator inertia, what does Model 1 make of rigid-body and friction forces?",
        f"The total fits ({checks[0].ours}), but its parts are nonsense: the rigid-body part is "
        f"off by {checks[1].ours} its size, the friction part by {checks[2].ours}.",
        tuple(checks),
        (StudyTable("Parts of the force, trajectory 601, all legs", pd.DataFrame(rows)),),
        (
            Gallery(
                tuple(figures),
                "Left: what Model 1 identifies without actuator inertia. Right: "
                "the exact parts of the same force.",
            ),
        ),
        ("Exact data, ordinary least squares, as in Table 6.",),
    )


if __name__ == "__main__":
    run_script(run)
