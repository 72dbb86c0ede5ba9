"""Effects hidden where a draw puts them, after the program is frozen: what does a diagnosis say?

The seed of the draw is the hash of the commit that is judged, so nobody has seen the cases before:
robot, family, joint, motions and noise of each. Every case is diagnosed with the part of the
effect that shows as large as the noise, and half as large; or, with --outside, with its name and
every name that is 90 % like it held back.

    python studies/hidden_effect_drawn.py --seed 1 --cases 20          # while developing
    python studies/hidden_effect_drawn.py --commit HASH --cases 75

Trials are written as they come; the same command goes on where it was stopped. The number of cases
is part of the plan: a run that was stopped says how many it has. Outside, effects are as large as
the noise.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from hidden_effect_cases import (
    NAMED,
    NAMELESS,
    ROBOTS,
    SIMILAR,
    SMOOTH,
    Case,
    draw_case,
    robot_of,
    run_case,
)
from scipy import stats

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import plain, write_json
from identifiability.report import Check, Prose, Section, frame_table, write_page

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]
#: Sizes of what shows of an effect, over the noise; least share of right names, and most of truths
#: with another name beside them.
SIZES, LEAST, MOST_MORE = (1.0, 0.5), {1.0: 0.90, 0.5: 0.75}, 0.03
#: Outside the dictionary: most wrong names, least share of smooth effects that are shown.
MOST_WRONG, LEAST_SHOWN = 0.08, 0.80
OUTCOMES = ("exact", "A or B", "truth and more", "function", "wrong", "none")


def seed_of(commit: str) -> int:
    """Return the seed that a commit gives; the checkout must be that commit.

    Raises
    ------
    IdentifiabilityError
    """
    ask = ["git", "-C", str(ROOT), "rev-parse", "--verify", f"{commit}^{{commit}}"]
    found = subprocess.run(ask, capture_output=True, text=True, check=False)
    if found.returncode:
        raise IdentifiabilityError(
            f"There is no commit '{commit}' here; give one of this checkout."
        )
    whole = found.stdout.strip()
    judged = ["git", "-C", str(ROOT), "diff", "--quiet", whole, "--", "identifiability", "studies"]
    if subprocess.run(judged, check=False).returncode:
        raise IdentifiabilityError(
            f"The checkout is not that of '{commit}'; check it out before it is judged."
        )
    return int(whole[:15], 16)


def run_rest(case: Case, sizes: Sequence[float], path: Path, *, outside: bool) -> None:
    """Run what a file does not have of a case; each trial is appended as soon as it is there."""
    done = {(r["number"], r["size"]) for r in read_trials(path)}
    for size in (s for s in sizes if (case.number, s) not in done):
        row: dict[str, Any] = plain(run_case(case, size, outside=outside))
        with path.open("a+b") as file:
            end = file.seek(0, 2)
            file.seek(max(end - 1, 0))
            cut = end and file.read(1) != b"\n"  # by a run that was stopped while it wrote
            file.write(b"\n" * bool(cut) + json.dumps(row).encode() + b"\n")
        where = f"{row['robot']}: {row['family']} in {row['place'] or 'the base'}"
        print(f"{where}, {row['size']} ×: {row['outcome']} [{row['named']}]", flush=True)


def read_trials(path: Path) -> list[dict[str, Any]]:
    """Return the trials of a file; a last line that was cut off is left out."""
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def check_named(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return what must hold of effects that have a name."""
    out = []
    for size in SIZES:
        part = frame[frame["size"] == size]
        told = part[part.similarity < SIMILAR]
        right = part.outcome.isin(["exact", "A or B"])
        out += [
            judge(
                f"exact at {size:g} ×, no rival 90 % like it", told.outcome == "exact", LEAST[size]
            ),
            judge(f'exact or "A or B" at {size:g} ×', right, LEAST[size]),
        ]
    more = frame.outcome == "truth and more"
    return [*out, judge("truth and more", more, MOST_MORE, most=True)]


def check_outside(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return what must hold of effects whose names are held back."""
    smooth = frame[frame.family.isin(SMOOTH)]
    shown = (smooth.outcome == "function") & (smooth.after < smooth.before)
    return [
        judge("a wrong name", frame.outcome == "wrong name", MOST_WRONG, most=True),
        judge("smooth ones shown, and less error on unseen motion", shown, LEAST_SHOWN),
    ]


def judge(what: str, hits: pd.Series[bool], limit: float, *, most: bool = False) -> dict[str, Any]:
    """Return a share with its 95 % interval [Clopper & Pearson 1934] and whether it holds."""
    n, k = len(hits), int(hits.sum())
    if not n:
        return {"what": what, "trials": 0, "hits": 0, "limit": limit, "holds": None}
    low, high = stats.binomtest(k, n).proportion_ci()
    holds = k / n <= limit if most else k / n >= limit
    share = {"share": k / n, "low": float(low), "high": float(high)}
    return {"what": what, "trials": n, "hits": k, **share, "limit": limit, "holds": holds}


def tell(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the checks as rows of a table."""
    out = []
    for r in rows:
        text = "no trials"
        if r["trials"]:
            text = f"{100 * r['share']:.1f} % ({100 * r['low']:.0f} … {100 * r['high']:.0f})"
        need = Check(text, r["holds"], f"limit {100 * r['limit']:.0f} %")
        out.append({"what": r["what"], "of": f"{r['hits']} of {r['trials']}", "share": need})
    return out


def count(frame: pd.DataFrame, by: str) -> pd.DataFrame:
    """Return how often each outcome came, one row for each value of a column."""
    table = frame.groupby([by, "outcome"]).size().unstack(fill_value=0)
    known = [name for name in OUTCOMES if name in table]
    return table[[*known, *(c for c in table if c not in known)]].reset_index()


def write(frame: pd.DataFrame, out: Path, planned: int, told: str, *, outside: bool) -> None:
    """Write the numbers and the page, and print the checks."""
    checks = check_outside(frame) if outside else check_named(frame)
    for r in checks:
        print(f"{r['what']}: {r['hits']} of {r['trials']}, limit {r['limit']:g}, {r['holds']}")
    failed = [r["what"] for r in checks if r["holds"] is False]
    verdict = f"Not met: {'; '.join(failed)}." if failed else "All that was asked for holds."
    statement = f"{len(frame)} of {planned} trials that were planned, {told}. {verdict}"
    data = {"schema": "identifiability/study/hidden-effect-drawn/1", "statement": statement}
    outcomes = frame.groupby(["size", "outcome"]).size().rename("trials").reset_index()
    print(
        write_json(
            out,
            {**data, "checks": checks, "outcomes": outcomes.to_dict("records"),
             "trials": frame.to_dict("records")},
        )
    )  # fmt: skip
    wrong = frame[~frame.outcome.isin(["exact", "A or B", "function"])]
    columns = ["robot", "family", "place", "size", "rival", "similarity", "outcome", "named"]
    sections = (
        Section("checks", "What must hold", "In brackets 95 % intervals.",
                (frame_table(pd.DataFrame(tell(checks))),)),
        Section("outcomes", "What became of them", "Trials by size, family and robot.",
                tuple(frame_table(count(frame, by)) for by in ("size", "family", "robot"))),
        Section("trials", "What was not named rightly", "",
                (frame_table(wrong[columns].round({"similarity": 2})),)),
        Section("method", "Method", "", (Prose((str(__doc__).partition("\n\n")[2],)),)),
    )  # fmt: skip
    page = out.with_suffix(".html")
    title = "Effects outside the dictionary" if outside else "Hidden effects, drawn"
    print(write_page(title, statement, sections, page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, or what is missing of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--commit", help="the commit that is judged; its hash draws the cases")
    which.add_argument("--seed", type=int, help="draws the cases while developing")
    parser.add_argument("--cases", type=int, default=75)
    parser.add_argument("--outside", action="store_true", help="hold the names back")
    parser.add_argument(
        "--part", default="0/1", help="of several processes at once, such as 0/3: its robots"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports", help="folder")
    given = parser.parse_args(argv)
    seed = seed_of(given.commit) if given.commit else given.seed
    told = f"drawn by commit {given.commit}" if given.commit else f"drawn by seed {given.seed}"
    families = (*NAMED, NAMELESS) if given.outside else NAMED
    sizes = SIZES[:1] if given.outside else SIZES
    given.out.mkdir(parents=True, exist_ok=True)
    out = given.out / f"hidden_effect_{'outside' if given.outside else 'drawn'}.json"
    # Outside and inside have no cases in common.
    seed += given.outside
    part, of = (int(x) for x in given.part.split("/"))
    order = sorted(range(given.cases), key=lambda k: ROBOTS.index(robot_of(seed, k)))
    own = [k for k in order if ROBOTS.index(robot_of(seed, k)) % of == part]
    trials = out.with_suffix(".jsonl")
    done = {(r["number"], r["size"]) for r in read_trials(trials)}
    cases = (
        draw_case(seed, k, families) for k in own if any((k, size) not in done for size in sizes)
    )
    for case in cases:
        run_rest(case, sizes, trials, outside=given.outside)
    frame = pd.DataFrame(read_trials(trials))
    if len(frame):
        frame = frame.sort_values(["number", "size"])
        write(frame, out, given.cases * len(sizes), told, outside=given.outside)


if __name__ == "__main__":
    main()
