"""Figure 6: does Model 4, fitted to one trajectory, predict another one?

Measured on the STAND-IN for the actual robot, whose data are not published: every pair of
trajectories, all four models.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from paper_study.command import Options, run_script
from paper_study.drawing import draw_bars
from paper_study.ladder_tables import MODELS
from paper_study.procedure import fitted_records, predict_record
from paper_study.result import StudyCheck, StudyResult, StudyTable, check_holds, check_range
from paper_study.subject import TRAJECTORIES, load_subject

from identifiability.foundation.names import Array
from identifiability.report import Gallery, Picture
from identifiability.report.figures import draw_torque

#: Fitted to the first, drawn on the second.
SHOWN = ("601", "595")


def find_checks(errors: dict[tuple[str, str], Array]) -> list[StudyCheck]:
    """Return the checks of Figure 6."""
    own = np.array([100 * e for (a, b), e in errors.items() if a == b])
    held = np.array([100 * e for (a, b), e in errors.items() if a != b])
    mean = held.mean(0)
    return [
        check_range(
            "ε_RA of Model 4 on unseen trajectories",
            held[:, 3],
            0,
            20,
            unit="%",
            paper="“very close”",
        ),
        check_range(
            "the same over that on its own trajectory, means",
            mean[3] / own[:, 3].mean(),
            0.9,
            1.5,
            paper="not given",
        ),
        check_holds(
            "Model 1 predicts unseen motion worse than Model 4",
            f"{mean[0]:.1f} against {mean[3]:.1f} %",
            mean[0] > mean[3],
            "Model 1 above Model 4",
            paper="not given",
        ),
    ]


def run(options: Options) -> StudyResult:
    """Validate the models on trajectories they have not seen."""
    subject = load_subject(options.robot)
    fitted = fitted_records(options)
    predictions = {
        (a, b): predict_record(subject, fitted[b].samples, fitted[a].values)
        for a in TRAJECTORIES
        for b in TRAJECTORIES
    }
    errors = {pair: p.relative_error() for pair, p in predictions.items()}
    shown = predictions[SHOWN]
    figures = [
        Picture(draw_torque(shown.t[0], shown.tau[:, k], shown.predicted[:, k, 3], joint, "N"))
        for k, joint in enumerate(subject.robot.joints)
    ]
    rows = [
        {"fitted to": a, "predicts": b, "kind": "own" if a == b else "unseen"}
        | {f"{model} [%]": 100 * float(e[m]) for m, model in enumerate(MODELS)}
        for (a, b), e in errors.items()
    ]
    checks = find_checks(errors)
    means = {
        kind: 100 * np.mean([e for (a, b), e in errors.items() if (a == b) == own], axis=0)
        for kind, own in (("own trajectory", True), ("unseen trajectory", False))
    }
    unseen = means["unseen trajectory"]
    return StudyResult(
        "figure_6_held_out",
        "Figure 6: a trajectory not seen before",
        "Does Model 4, fitted to one trajectory, predict another one?",
        "Yes, on the stand-in: fitted to one trajectory, Model 4 predicts the two others with an "
        f"ε_RA of {unseen[3]:.1f} %, Model 1 with {unseen[0]:.1f} %.",
        tuple(checks),
        (StudyTable("ε_RA of every pair of trajectories, stand-in", pd.DataFrame(rows)),),
        (
            Gallery(
                tuple(figures),
                f"Model 4 fitted to trajectory {SHOWN[0]} of the stand-in, predicting {SHOWN[1]}.",
            ),
            Picture(
                draw_bars(MODELS, means, "Fitted and unseen motion", "ε_RA [%]"),
                "Mean over trajectories: the larger the model, the worse it predicts.",
            ),
        ),
        ("The stand-in and the procedure are those of the report on Table 7.",),
        {
            "error_ra": [
                {"fit": a, "predict": b, "error_ra": e.tolist()} for (a, b), e in errors.items()
            ]
        },
    )


if __name__ == "__main__":
    run_script(run)
