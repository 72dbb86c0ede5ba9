"""Figure 3: how near is the simulated robot to the machine along three trajectories?

The simulated robot is the robot file with linear friction; the machine is the STAND-IN for the
actual robot, whose data are not published. Both forces belong to the motion that the stand-in made.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from paper_study.command import Options, run_script
from paper_study.drawing import draw_parts
from paper_study.procedure import process, records
from paper_study.result import StudyCheck, StudyResult, StudyTable, check_range
from paper_study.subject import load_subject

from identifiability.foundation.names import Array
from identifiability.logs.prepare import Dataset
from identifiability.report import Gallery, Picture
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, simulate

#: The paper's order: (a), (b), (c).
ORDER = ("595", "571", "601")


def simulated_force(robot: Robot, samples: Dataset) -> Array:
    """Return the force of the simulated robot along the motion of a record, (N, n)."""
    m = samples.motion
    move = PrescribedMotion(m.t, m.actuated_q, m.actuated_v, m.actuated_a, samples.name)
    force: Array = simulate(robot, move, noise=Noise()).tau
    return force


def agreement(machine: Array, simulated: Array) -> tuple[float, Array]:
    """Return ε_RA in percent, and the correlation of each leg."""
    error = np.abs(machine - simulated).sum() / np.abs(machine - machine.mean()).sum()
    pairs = zip(machine.T, simulated.T, strict=True)
    return float(100 * error), np.array([np.corrcoef(a, b)[0, 1] for a, b in pairs])


def find_checks(found: dict[str, tuple[float, Array]]) -> list[StudyCheck]:
    """Return the limits of the distance between the curves; the paper gives no number."""
    correlations = np.concatenate([r for _, r in found.values()])
    return [
        check_range(
            "correlation of every leg and trajectory",
            correlations,
            0.95,
            1,
            paper="curves lie on each other",
        ),
        check_range(
            "ε_RA of the simulated robot against the stand-in",
            [e for e, _ in found.values()],
            0,
            25,
            unit="%",
            paper="not given",
        ),
    ]


def run(options: Options) -> StudyResult:
    """Draw Figure 3."""
    subject = load_subject(options.robot)
    data = records(options)
    found, figures, rows = {}, [], []
    for letter, name in zip("abc", ORDER, strict=True):
        samples = process(subject, data[name])
        force = simulated_force(subject.robot, samples)
        found[name] = agreement(samples.tau, force)
        rows.append(
            {
                "trajectory": f"({letter}) {name}",
                "ε_RA [%]": found[name][0],
                "lowest correlation": float(found[name][1].min()),
                "largest force of the stand-in [N]": float(np.abs(samples.tau).max()),
            }
        )
        for k, joint in enumerate(subject.robot.joints):
            parts = {"simulated robot": force[:, k], "stand-in": samples.tau[:, k]}
            title = f"({letter}) trajectory {name}, {joint}"
            figures.append(Picture(draw_parts(samples.motion.t, parts, title)))
    worst = max(e for e, _ in found.values())
    return StudyResult(
        "figure_3_forces",
        "Figure 3: forces of three trajectories",
        "How near is the simulated robot to the machine along three trajectories?",
        "Along all three trajectories the simulated robot follows the stand-in (the actual robot's "
        f"data are not published) with an ε_RA of at most {worst:.0f} %.",
        tuple(find_checks(found)),
        (StudyTable("Agreement by trajectory", pd.DataFrame(rows)),),
        (
            Gallery(
                tuple(figures),
                "Force of each slide: the stand-in's filtered control actions and "
                "the simulated robot along the same motion.",
            ),
        ),
        (
            "No parameter was fitted here: the simulated robot has the robot file's inertias and "
            "friction, the stand-in is made unlike it on purpose (report on Table 7).",
        ),
    )


if __name__ == "__main__":
    run_script(run)
