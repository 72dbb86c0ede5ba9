"""Figure 4: how does the error of the prediction grow with noise on motion and on forces?

ε_RA of Model 1 for δ from 0 to 4 % and η from 0 to 5 %, against the noisy force (the paper's) and
against the exact one; and above which δ the direct kinematics finds no solution any more.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from paper_study.command import Options, run_script
from paper_study.drawing import draw_lines
from paper_study.ladder_tables import Trials, percent, spread, trial_records
from paper_study.monte_carlo import Case, run_trials, stack, variants
from paper_study.printed import printed_models
from paper_study.result import StudyCheck, StudyResult, StudyTable, check_holds, check_range
from paper_study.subject import TRAJECTORIES

from identifiability.report import Picture

DELTAS = (0.0, 0.01, 0.02, 0.03, 0.04)
ETAS = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05)
BEYOND = (0.04, 0.05, 0.06, 0.08)


def draw(trials: Trials, name: str, title: str) -> Picture:
    """Draw an error of Model 1 over δ, one line for some levels of η."""
    lines = {}
    deltas, etas = levels(trials)
    for eta in etas if len(etas) < 4 else [*etas[::2], etas[-1]]:
        some = [percent(trials[c], name)[:, 0] for c in trials if c.eta == eta]
        label = f"η = {100 * eta:g} %"
        lines[label] = (np.array([x.mean() for x in some]), np.array([x.std() for x in some]))
    figure = draw_lines(
        100 * np.array(deltas), lines, title, "noise on the motion δ [%]", "ε_RA of Model 1 [%]"
    )
    return Picture(figure, f"{title}: mean ± sd over seeds, trajectory 601, 750 samples.")


def levels(trials: Trials) -> tuple[list[float], list[float]]:
    """Return the levels of δ and of η."""
    return sorted({c.delta for c in trials}), sorted({c.eta for c in trials})


def grid_table(trials: Trials) -> StudyTable:
    """Return ε_RA of Model 1 over δ and η."""
    rows = [
        {"δ": f"{100 * d:g} %"}
        | {
            f"η = {100 * c.eta:g} %": spread(percent(some, "error_ra")[:, 0])
            for c, some in trials.items()
            if c.delta == d
        }
        for d in levels(trials)[0]
    ]
    return StudyTable("ε_RA of Model 1 against the noisy force [%]", pd.DataFrame(rows))


def closure_table(options: Options) -> tuple[StudyTable, dict[float, float]]:
    """Return how many samples' loops do not close at each δ, mean over runs of all trajectories."""
    base = Case("601", eta=0.0, robot=options.robot)
    beyond = BEYOND[:: 3 if options.quick else 1]
    cases = variants(base, trajectory=TRAJECTORIES, delta=beyond)
    trials = run_trials(cases, options.fewer(10, 1), options.engine, options.progress)
    rows = {
        d: [stack(t, "dropped").mean() for c, t in trials.items() if c.delta == d] for d in beyond
    }
    frame = pd.DataFrame(
        [
            {"δ": f"{100 * d:g} %"} | dict(zip(TRAJECTORIES, found, strict=True))
            for d, found in rows.items()
        ]
    )
    caption = "Samples of 750 whose loops do not close, mean a run, by trajectory"
    return StudyTable(caption, frame), {d: float(np.mean(x)) for d, x in rows.items()}


def find_checks(trials: Trials, lost: dict[float, float]) -> list[StudyCheck]:
    """Return the checks of Figure 4, and of the paper's statements about it."""
    at = {(c.delta, c.eta): t for c, t in trials.items()}
    motion, force = at[0.04, 0.0], at[0.0, 0.05]
    means = {
        (name, kind): float(percent(some, kind)[:, 0].mean())
        for name, some in (("motion", motion), ("force", force))
        for kind in ("error_ra", "error_exact")
    }
    noisy = printed_models("table_3")["Model 1"]["error_ra"]
    deltas, etas = levels(trials)
    grid = np.array([[percent(at[d, e], "error_ra")[:, 0].mean() for e in etas] for d in deltas])
    return [
        check_range("ε_RA without noise", grid[0, 0], 0, 1e-6, unit="%", printed=0.0),
        check_holds(
            "ε_RA grows with δ and with η",
            f"{grid[0, 0]:.2f} … {grid[-1, -1]:.2f} %",
            bool((np.diff(grid, axis=0) > 0).all() and (np.diff(grid, axis=1) > 0).all()),
            "along both axes",
            paper="grows",
        ),
        check_range("ε_RA at δ = 4 %, η = 5 %", grid[-1, -1], 4.1, 4.8, unit="%", printed=noisy),
        check_holds(
            "δ = 4 % alone adds more than η = 5 % alone, against the noisy force",
            f"{means['motion', 'error_ra']:.2f} against {means['force', 'error_ra']:.2f} %",
            means["motion", "error_ra"] > means["force", "error_ra"],
            "δ above η",
            paper="“a greater increment”",
            required=False,
            reason="ε_RA against the noisy force (Eq. 18) contains the noise of the force itself",
        ),
        check_holds(
            "the same against the exact force",
            f"{means['motion', 'error_exact']:.2f} against {means['force', 'error_exact']:.2f} %",
            means["motion", "error_exact"] > 2 * means["force", "error_exact"],
            "δ above twice η",
            paper="“a greater increment”",
        ),
        check_holds(
            "direct kinematics is solved up to δ = 4 %, not above",
            f"{lost[0.04]:.2f} / {lost[0.08]:.2f}",
            lost[0.04] < 0.5 < lost[0.08],
            "samples lost a run: < 0.5 at 4 %, > 0.5 at 8 %",
            paper="no solution above 4 %",
        ),
    ]


def run(options: Options) -> StudyResult:
    """Draw Figure 4 and state its result."""
    grid = (DELTAS[::2], (0.0, *ETAS[3::2])) if options.quick else (DELTAS, ETAS)
    cases = variants(Case("601", robot=options.robot), delta=grid[0], eta=grid[1])
    draws = options.fewer(10, 1)
    trials = run_trials(cases, draws, options.engine, options.part("noise levels", 0, 0.8).progress)
    closures, lost = closure_table(options.part("direct kinematics", 0.8, 1))
    checks = find_checks(trials, lost)
    return StudyResult(
        "figure_4_noise_levels",
        "Figure 4: noise levels",
        "How does the error of the prediction grow with noise on motion and on forces?",
        f"With both. Against the noisy force, force noise adds more ({checks[3].ours}); against "
        f"the exact force, motion noise does ({checks[4].ours}), because least squares averages "
        "the force noise out.",
        tuple(checks),
        (grid_table(trials), closures),
        (
            draw(trials, "error_ra", "Against the noisy force (Eq. 18)"),
            draw(trials, "error_exact", "Against the exact force"),
        ),
        (f"Per-sample noise as in Table 3, {draws} seeds, trajectory 601, 750 samples.",),
        {"trials": trial_records(trials), "seeds": draws},
    )


if __name__ == "__main__":
    run_script(run)
