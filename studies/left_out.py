"""Do a reduced model's 95 % intervals hold what its labels say, on robots unlike their file?

Every repetition draws a new true robot, uniformly among the physically possible ones whose bodies'
m, m·r and m·r² lie within 30 % of the file's, and new noise. The analysis knows the file only. The
30 % was fixed before anything was measured. Beside the label's interval stands the sampling
interval, which knows nothing of what a model leaves out.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from left_out_trials import REPLICATES, SETTINGS, Tally, measure

from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.numbers import Share
from identifiability.foundation.output import write_json
from identifiability.report import Check, Fold, Picture, Prose, Section, frame_table, write_page
from identifiability.report.calibration_report import draw_each

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: What must hold of the label's intervals and of what is called identifiable.
LEAST_POOLED, LEAST_WORST, MOST_WRONG = 0.93, 0.85, 0.02

#: Shares of fewer verdicts say little.
FEWEST_CALLS = 50

WRONGS = ("wrong", "wrong_before")


def tell(share: Share) -> str:
    """Return ``95.1 % (94.2 … 95.9)``."""
    low, high = f"{100 * share.low:.1f}", f"{100 * share.high:.1f}"
    return "–" if np.isnan(share.value) else f"{100 * share.value:.1f} % ({low} … {high})"


def tally_row(t: Tally) -> dict[str, Any]:
    """Return a row of the table; what is asked for is checked."""
    name, worst = t.worst
    calls = round(t.identifiable * t.logs)
    count = f"{round(t.wrong.value * calls) if calls else 0} of {calls}"
    few = calls < FEWEST_CALLS
    pooled = Check(tell(t.label), t.label.value >= LEAST_POOLED, "at least 93 %")
    each = Check(f"{100 * worst.value:.0f} %", worst.value >= LEAST_WORST, f"{name}; at least 85 %")
    wrong = Check(tell(t.wrong), None if few else t.wrong.value <= MOST_WRONG, count)
    return {
        "logs": title(t),
        "parameters": f"{t.parameters:.1f}",
        "label held": pooled,
        "worst parameter": each,
        "identifiable and wrong": wrong,
    }


def cost_row(t: Tally) -> dict[str, Any]:
    """Return a row of what the sampling interval would say, and what it costs to know better."""
    return {
        "logs": title(t),
        "label held": tell(t.sampling),
        "identifiable and wrong": tell(t.wrong_before),
        "model's own value held": tell(t.pseudo),
        "widening": f"{t.widening:.2f} ×",
        "identifiable a log": f"{t.before:.1f} → {t.identifiable:.1f}",
    }


def title(t: Tally) -> str:
    """Return setting and model."""
    return f"{t.setting}, {t.model}"


def state(tallies: Sequence[Tally]) -> str:
    """Return the answer in plain words."""
    biased = [t for t in tallies if t.pseudo.high < LEAST_POOLED]
    text = ""
    if sound := [t for t in tallies if t not in biased]:
        new, old = ([100 * getattr(t, of).value for t in sound] for of in ("label", "sampling"))
        kept = min(sound, key=lambda t: t.identifiable / max(t.before, 1e-9))
        text += (
            f"The label's 95 % intervals hold it in {min(new):.1f} to {max(new):.1f} % (sampling "
            f"intervals: {min(old):.1f} to {max(old):.1f} %). The costliest case, {title(kept)}: "
            f"{kept.identifiable:.1f} instead of {kept.before:.1f} parameters of a log are "
            "identifiable. "
        )
    if biased:
        names = "; ".join(f"{title(t)} {100 * t.label.value:.0f} %" for t in biased)
        text += (
            "Not where errors in the motion bias the fit, so that even the value that the model "
            f"itself would have is missed: {names}. "
        )
    wrong, before = (np.nanmax([getattr(t, of).value for t in tallies]) for of in WRONGS)
    return text + (
        f"Of what is called identifiable at most {100 * wrong:.2g} % is off by more than half; by "
        f"the sampling interval {100 * before:.2g} %."
    )


def write(tallies: Sequence[Tally], out: Path, trials: int, seed: int) -> None:
    """Write the page and the numbers, and print where."""
    labels = [text for t in tallies for text in (title(t), "sampling interval")]
    shares = [s for t in tallies for s in (t.label, t.sampling)]
    every = Picture(
        draw_shares(labels, shares), "The label's interval, below it the sampling interval."
    )
    folds = [Fold(title(t), (Picture(draw_shares(t.names, t.each)),)) for t in tallies]
    method = (
        f"{trials} logs of every row, seed {seed}: each of a new robot with new noise. Bodies are "
        f"drawn uniformly within {100 * ESTIMATION_RULES.body_share:g} % of the file's m, m·r and "
        "m·r² (r: rms distance of the mass from the body's frame) and kept where they can exist; "
        "friction and rotors are the file's. 3-RPS: 4 % noise on the motion, 5 % on the forces; "
        "five-bar: 5 % on the torque. The label of a parameter is what its combination of the "
        "unpruned parameters comes to on the drawn robot. "
        f"Every log is analysed as a user would, with {REPLICATES} resampled logs, and pruned by "
        "itself. The worst parameter is the worst of those in at least half of the logs; shares "
        f"of fewer than {FEWEST_CALLS} verdicts are not checked."
    )
    table = frame_table(pd.DataFrame([tally_row(t) for t in tallies]), "By the label's interval")
    cost = frame_table(pd.DataFrame([cost_row(t) for t in tallies]), "By the sampling interval")
    lead = (
        "The label's interval knows what the model leaves out; the sampling interval knows the "
        "residual only. In brackets 95 % Monte-Carlo intervals. Widening: median ratio of the "
        "widths. The model's own value is what it would fit without noise: where that is missed, "
        "it is not for what is left out. × 10: ten periods of the motion."
    )
    sections = (
        Section("coverage", "Do intervals hold what the labels say?", lead, (every, table, cost)),
        Section("parameters", "Every parameter", "The label's interval.", tuple(folds)),
        Section("method", "Method", "", (Prose((method,)),)),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    data = {
        "schema": "identifiability/study/left-out/1",
        "statement": state(tallies),
        "trials": trials,
        "seed": seed,
        "rows": [asdict(t) for t in tallies],
    }
    print(state(tallies))
    print(write_json(out, data))
    page = out.with_suffix(".html")
    print(write_page("What a model leaves out", state(tallies), sections, page, overline="Study"))


def draw_shares(names: Sequence[str], shares: Sequence[Share]) -> Any:
    """Draw shares with their Monte-Carlo intervals."""
    value, low, high = np.array([(s.value, s.low, s.high) for s in shares]).T
    return draw_each(names, value, low, high)


def main(argv: Sequence[str] | None = None) -> tuple[Tally, ...]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="left_out", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "left_out.json")
    parser.add_argument("--quick", action="store_true", help="4 logs of every setting, not 100")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    trials = 4 if given.quick else given.trials
    tallies = tuple(t for s in SETTINGS for t in measure(s, trials, given.seed))
    write(tallies, given.out, trials, given.seed)
    return tallies


if __name__ == "__main__":
    main()
