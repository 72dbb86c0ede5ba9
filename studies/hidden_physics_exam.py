"""Examine `diagnose` on robots of another physics: does it name effects, and does that help?

    python studies/hidden_physics_exam.py --cases 40 --folder SCRATCH --out reports
    python studies/hidden_physics_exam.py --commit HASH --cases 240 --folder SCRATCH
    python studies/hidden_physics_exam.py --rows reports/hidden_physics.jsonl

`hidden_physics_cases` draws and simulates the cases (kept in the scratch folder), `diagnose` gets
the robot file, three logs to fit and one that vetoes; a fifth, sealed log only scores. One case
after another; a stopped run goes on with the same command; with `--rows` nothing is run, and the
table of such rows is printed. Shares have Wilson's 95 % intervals. An effect counts as visible
where an oracle's z is at least 4; a second column counts effects whose second z, with motion as
encoders measure it, is at least 4 (`hidden_physics_cases`). Where nothing is hidden, the trust card
of `analyze` must not say that an effect is missing. It may warn of masses, which are wrong in the
robot files, and of joints that stick.

Outcomes of effects with a name: *exact* (family and place, nothing else), *A or B* (the truth is
among names that the diagnosis cannot distinguish; friction that rises with speed and sigmoid
friction are one curve), *truth and more*, *function* (in the right joint, without a name), *wrong*,
*missed* and, below z = 4, *silent*. Names are exact where the outcome is one of the first two: each
effect is named once, in its place, and nothing else is named. An extra name describes nothing, or
repeats another name. Outside the dictionary a name is wrong if neither it nor its joint describes
the hidden effect; presliding in a joint that sticks is none where the sealed error falls.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from hidden_effect import read_rows
from hidden_physics_cases import FITTED, KINDS, load_logs, load_robot, make_case
from scipy.special import chdtri
from shared import study_parser, wilson

from identifiability import analyze, diagnose
from identifiability.estimation.mixed_model import EVERYWHERE, MixedModel, Term
from identifiability.estimation.noise import JointNoise
from identifiability.estimation.rules import RULES as NAMES
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import plain, write_json
from identifiability.report import Prose, Section, check_cell, frame_table, write_page
from identifiability.report.results import answer_first
from identifiability.workflows.diagnose.naming import look, name_missing

ROOT = Path(__file__).resolve().parents[1]
#: z from which on an effect counts as visible, and weight from which on a name is sure.
VISIBLE, SURE = 4.0, 0.95
#: z from which on it is asked where its evidence was lost.
STRONG = 5.0
#: z from which on names must be exact.
CLEAR = 8.0
#: Outcomes that lost nothing.
FOUND = ("exact", "A or B", "described", "silent")
#: Names of one curve.
CURVE = {"sigmoid_friction": "rising_friction"}
#: Edges of z between which outcomes are counted.
EDGES = (0.0, VISIBLE, 8.0, 16.0, 32.0, np.inf)
#: Which rows.
Which = Callable[[pd.DataFrame], pd.Series]


@dataclass(frozen=True)
class Rule:
    """What must hold.

    Attributes
    ----------
    what : str
    of, hits : callable
        Which cases count, and which of these are hits.
    limit : float
        Share of hits, at least, or at most if `most`; nan for a figure without a limit.
    upper : float
        The upper end of the share's interval at most.
    counts : bool
        Whether hits are a number of names a case, not a share of cases.
    """

    what: str
    of: Which
    hits: Which
    limit: float = float("nan")
    most: bool = False
    upper: float = 1.0
    counts: bool = False


def examine(path: Path) -> dict[str, Any]:
    """Return the diagnosis of a case, and its score."""
    truth = json.loads((path / "truth.json").read_text())
    robot, logs = load_robot(path), load_logs(path)
    fitted, unseen, sealed = logs[:FITTED], logs[FITTED : FITTED + 1], logs[FITTED + 1 :]
    begin = time.process_time()
    d = diagnose(robot, fitted, unseen, forward=False)
    seconds = time.process_time() - begin
    error = [float("nan")] * 2
    if d.effects or d.changes:
        bare = diagnose(robot, fitted, unseen, forward=False, effects=())
        error = [sealed_error(x, sealed) for x in (bare, d)]
    named = [
        {
            "family": e.name,
            "unnamed": bool(e.unnamed),
            "joint": p.place,
            "shape": float(p.shape),
            "weight": float(getattr(p, "weight", np.nan)),
            "or": [[r.family, r.place] for r in p.rivals],
        }
        for e in d.effects
        for p in e.placements
    ]
    named += [
        {"family": c.family, "unnamed": False, "joint": c.place, "shape": float("nan"),
         "weight": c.weight, "or": [list(other) for other in c.rivals], "when": c.when}
        for c in d.changes
    ]  # fmt: skip
    effects = truth["effects"]
    card = ""
    if truth["kind"] == "null":
        a = analyze(robot, fitted, unseen, quick=True)
        card = "missing" if a.missing.statement else answer_first(a).answers[2].tone
    row = {
        "case": path.name,
        **{k: truth[k] for k in ("number", "kind", "robot")},
        "hidden": "; ".join(f"{e['family']}@{e['place']}" for e in effects),
        "z": min((e["z"] for e in effects), default=0.0),
        "z_measured": min((e["z measured"] for e in effects), default=0.0),
        "noise": truth["noise"]["level"],
        "stands": float(np.mean(truth["stands"])),
        "said": "; ".join(_say(n) for n in named),
        "refuted": "; ".join(f"{e.name}@{e.place}" for e in d.refuted),
        "before": error[0],
        "after": error[1],
        "held_before": d.held_before,
        "held_after": d.held_after,
        "seconds": seconds,
        "card": card,
    }
    row |= judge(truth, named, falls=error[1] < error[0])
    row["lost"] = [] if row["outcome"] in FOUND else [
        trace(d, e, truth) for e in effects if not any(_says(n, e) for n in named)
    ]  # fmt: skip
    return {**row, "named": named}


#: Steps that may lose the evidence of a hidden effect, in words.
STEPS = {
    "price": "its price: an oracle's evidence would not pay it",
    "preparation": "measured motion: encoders, rows at rest and turns",
    "band": "low-pass and shapes, under the noise that was put on",
    "noise": "noise of the rich model",
    "rivals": "other groups of the search",
    "left-out blocks": "blocks of the fitted logs that were predicted from the others",
    "unseen log": "the log that may refute",
    "beside other names": "nothing of it: more is named beside it",
    "no group": "no group at its place",
}


def count_losses(frame: pd.DataFrame) -> pd.DataFrame:
    """Return at which step effects of z ≥ 5 that were not named were lost, inside and outside."""
    lost = [
        {"kind": r["kind"], "at": x["at"]}
        for r in frame.to_dict("records")
        for x in (r["lost"] if isinstance(r.get("lost"), list) else [])
        if x["z"] >= STRONG
    ]
    table = pd.DataFrame(lost, columns=["kind", "at"])
    table["lost to"] = table["at"].map(STEPS)
    return pd.crosstab(table["lost to"], table["kind"], margins=True).reset_index()


def trace(d: Any, effect: dict[str, Any], truth: dict[str, Any]) -> dict[str, Any]:
    """Return the evidence for an effect that each step keeps [nat], and the step that loses it.

    It is lost at the first step whose evidence is below the limit for a name plus its price. The
    price is that of the likeliest of its groups, with the cost of an average over shapes and sizes.
    The first steps are the motion as encoders measure it, the band, and the shapes of the groups
    under the noise that was added to the torque. Then follow the noise of the rich model, other
    groups, left-out blocks, and the log that may refute.
    """
    looked = look(d.problem)
    found = name_missing(looked)

    def true(t: Term) -> bool:
        return t.group.place != EVERYWHERE and _is(*t.key, effect)

    missing, model = found.search.missing, found.search.model
    level = truth["noise"]["level"]
    step = float(np.median(np.diff(found.fitted.seen.t)))
    rho = truth["noise"]["rho at 100 Hz"] ** (100.0 * step)
    put = [JointNoise(np.array([rho]), level * x * np.sqrt(1 - rho**2)) for x in truth["rms"]]
    own = next(filter(true, found.before), None)
    if own is None:
        return {"family": effect["family"], "z": effect["z"], "at": "no group"}

    def gain(m: MixedModel) -> float:
        return m.solve((own,)).log_likelihood - m.solve().log_likelihood

    kept = model.search()
    paid = gain(model) - own.odds
    left = {
        "oracle": effect["z"] ** 2 / 2 - paid,
        "preparation": effect["z measured"] ** 2 / 2 - paid,
        "band": gain(missing.under(put).model()) - paid,
        "noise": own.odds,
    }
    rest = tuple(t for t in kept if not true(t))
    beside = [t for t in model.gains(rest) if true(t)]
    steps = {"oracle": "price", "preparation": "preparation", "band": "band", "noise": "noise"}
    at = next((steps[k] for k, x in left.items() if x < NAMES.name), "")
    left |= {"rivals": max((t.odds for t in beside), default=np.nan), "paid": paid}
    if not at and any(true(t) for t, _ in found.possible):
        at = "left-out blocks"
    if not at and not any(map(true, kept)):
        at = "rivals"
    stays = [t for t in kept if t.key not in {x.key for x, _ in found.refuted}]
    if not at and not any(map(true, stays)):
        at = "unseen log"
    said = "; ".join(f"{t.group.family}@{t.group.place} {t.odds:.1f}" for t in kept)
    return {"family": effect["family"], "z": effect["z"], "at": at or "beside other names",
            **left, "search": said}  # fmt: skip


def sealed_error(d: Any, sealed: Sequence[Any]) -> float:
    """Return the error of a result's model relative to each joint's scale, where joints move."""
    p = d.predict(sealed)
    data = p.known & np.isfinite(p.tau)
    left = np.where(data, p.tau - p.predicted, 0.0)
    centred = p.tau - np.where(data, p.tau, 0.0).sum(0) / np.maximum(data.sum(0), 1)
    scale = (np.where(data, centred, 0.0) ** 2).sum(0)
    known = scale > 0
    return float(np.sqrt(np.mean((left**2).sum(0)[known] / scale[known])))


def _say(named: dict[str, Any]) -> str:
    rest = "".join(f" or {family}@{place}" for family, place in named["or"])
    when = f", {named['when']}" if "when" in named else ""
    return f"{named['family']}@{named['joint']}{rest}{when}"


def _is(family: str, place: str, effect: dict[str, Any]) -> bool:
    """Whether a name in a place describes the hidden effect."""
    whole = "base" in (place, effect["place"])
    fits = {CURVE.get(f, f) for f in effect["fits"]}
    return CURVE.get(family, family) in fits and (whole or place == effect["place"])


def _says(named: dict[str, Any], effect: dict[str, Any]) -> bool:
    """Whether the hidden effect is among the names of a part."""
    return any(_is(f, p, effect) for f, p in [[named["family"], named["joint"]], *named["or"]])


def judge(truth: dict[str, Any], named: Sequence[dict[str, Any]], *, falls: bool) -> dict[str, Any]:
    """Return the outcome of a case, the wrong names, and the sure ones among them.

    Parameters
    ----------
    truth : dict
        With `effects` and the share of time that each joint `stands`.
    named : sequence of dict
        family, joint, unnamed, weight, and the competing names (`or`).
    falls : bool
        Whether the sealed error does.
    """
    effects, kind = truth["effects"], truth["kind"]
    named = list({(n["family"], n["joint"]): n for n in named}.values())  # parameters apart
    places = {e["place"] for e in effects}
    stands = dict(zip(truth["joints"], truth["stands"], strict=True))

    def exact(n: dict[str, Any]) -> bool:
        return any(_is(n["family"], n["joint"], e) for e in effects)

    def among(n: dict[str, Any]) -> bool:
        return exact(n) or any(_is(f, p, e) for f, p in n["or"] for e in effects)

    def harmless(n: dict[str, Any]) -> bool:
        presliding = n["family"] == "hysteresis" and falls and stands.get(n["joint"], 0.0) > 0
        if kind == "outside":
            return bool(n["unnamed"]) or presliding
        return bool(n["unnamed"]) and (n["joint"] in places or "base" in places)

    found = [any(_says(n, e) for n in named) for e in effects]
    wrong = [n for n in named if not among(n) and not harmless(n)]
    right = bool(effects) and all(found)
    if not named:
        seen = any(e["z"] >= VISIBLE for e in effects)
        outcome = "missed" if seen else "silent"
    elif kind == "null":
        outcome = "wrong"
    elif kind == "outside":
        outcome = "wrong" if wrong else "described" if any(found) else "elsewhere"
    elif right and len(named) == len(effects):
        outcome = "exact" if all(n["family"] == e["family"] and exact(n) for n, e in
                                 _pair(named, effects)) else "A or B"  # fmt: skip
    elif right:
        outcome = "truth and more"
    elif all(n["unnamed"] and harmless(n) for n in named):
        outcome = "function"
    elif len(effects) > 1 and any(found) and not wrong:
        outcome = "some of them"
    else:
        outcome = "wrong"
    sure = [n for n in named if n["weight"] >= SURE and not n["unnamed"]]
    return {
        "outcome": outcome,
        "wrong": "; ".join(f"{n['family']}@{n['joint']}" for n in wrong),
        "described": any(found),
        "extra": count_extra(
            effects,
            named,
            described=lambda n, e: _says(n, e) or (harmless(n) and n["joint"] == e["place"]),
        ),
        "sure": len(sure),
        "sure_right": sum(exact(n) for n in sure),
    }


def count_extra(
    effects: Sequence[dict[str, Any]],
    named: Sequence[dict[str, Any]],
    described: Callable[[dict[str, Any], dict[str, Any]], bool],
) -> int:
    """Return how many names describe no hidden effect, or repeat another name."""
    matched = sum(any(described(n, e) for n in named) for e in effects)
    return max(len(named) - matched, 0)


def _pair(named: Sequence[Any], effects: Sequence[Any]) -> list[tuple[Any, Any]]:
    """Return names with the effects in their places, in one order."""
    ordered = [sorted(x, key=lambda y: (y["family"], y.get("joint", y.get("place"))))
               for x in (named, effects)]  # fmt: skip
    return list(zip(*ordered, strict=True))


def _right(f: pd.DataFrame) -> pd.Series:
    return f.outcome.isin(["exact", "A or B"])


def _seen(kind: str, z: str = "z") -> Which:
    """Return which cases of a kind are visible, by one of the oracle's two z."""
    return lambda f: (f.kind == kind) & (f[z] >= VISIBLE)


def _rules(z: str) -> list[Rule]:
    """Return the rules for visible effects; limits hold for the first z only."""
    first = z == "z"
    seen = "visible" if first else "visible in measured motion"

    def rule(kind: str, what: str, hits: Which, limit: float, *, most: bool = False) -> Rule:
        return Rule(f"{kind}, {seen}: {what}", _seen(kind.partition(" ")[0], z), hits,
                    limit if first else float("nan"), most)  # fmt: skip

    return [
        rule("inside", "exact or A or B", _right, 0.70),
        rule("inside", "truth and more", lambda f: f.outcome == "truth and more", 0.10, most=True),
        rule("inside", "wrong", lambda f: f.outcome == "wrong", 0.05, most=True),
        rule("two at once", "both named", lambda f: _right(f) | (f.outcome == "truth and more"),
             0.60),
        rule("outside", "described in its joint", lambda f: f.described, 0.65),
    ]  # fmt: skip


def _clear(f: pd.DataFrame) -> pd.Series:
    """Return which cases hide effects that have a name and are clearly visible."""
    return f.kind.isin(["inside", "two", "several", "strong"]) & (f.z >= CLEAR)


#: Required limits, and further figures.
RULES: tuple[Rule, ...] = (
    Rule(f"names are exact, z ≥ {CLEAR:g}", _clear, _right, 0.70),
    Rule("extra names a case", lambda f: f.kind != "null", lambda f: f.extra, 0.10, most=True,
         counts=True),
    Rule("nulls that stick: named", lambda f: f.kind == "null", lambda f: f.said != "", 2 / 60,
         True, 0.12),
    Rule("nulls that stick: analyze says nothing is missing", lambda f: f.kind == "null",
         lambda f: f.card != "missing", 0.95),
    *_rules("z"),
    Rule("outside: a wrong name", lambda f: f.kind == "outside", lambda f: f.outcome == "wrong",
         0.05, True),
    Rule(f"several joints, z ≥ {CLEAR:g}: names are exact",
         lambda f: (f.kind == "several") & (f.z >= CLEAR), _right),
    Rule("the sealed error falls where something is named", lambda f: f.said != "",
         lambda f: f.after < f.before, 0.90),
    *(Rule(f"a wrong name, {kind}", lambda f, kind=kind: f.kind == kind, lambda f: f.wrong != "")
      for kind in ("inside", "two", "several", "strong", "outside")),
    *_rules("z_measured"),
)  # fmt: skip


def poisson(hits: int, of: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a mean count [Garwood 1936]."""
    low = float(chdtri(2 * hits, 0.975)) if hits else 0.0
    return low / (2 * of), float(chdtri(2 * hits + 2, 0.025)) / (2 * of)


def check(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the required limits: hits, cases, share with its interval, limit."""
    counts = [
        (r, int(r.hits(part).sum()), len(part)) for r in RULES for part in [frame[r.of(frame)]]
    ]
    sure = Rule(f"names of weight ≥ {SURE:g} that are right", _seen(""), _right, 0.93)
    counts.append((sure, int(frame.sure_right.sum()), int(frame.sure.sum())))
    out = []
    for r, hits, of in counts:
        row = {"what": r.what, "hits": hits, "of": of, "limit": r.limit, "most": r.most}
        if of:
            low, high = poisson(hits, of) if r.counts else wilson(hits, of)
            holds = (hits / of <= r.limit and high <= r.upper) if r.most else hits / of >= r.limit
            row |= {"share": hits / of, "low": low, "high": high}
            row["holds"] = None if np.isnan(r.limit) else bool(holds)
            row["need"] = "" if np.isnan(r.limit) else f"{'≤' if r.most else '≥'} {r.limit:.2f}"
            if r.upper < 1.0:
                row["need"] += f", upper ≤ {r.upper:.2f}"
        out.append(row)
    return out


def count(frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the counts of outcomes by kind, by z, by robot, and the cards of nulls."""
    hides, nulls = frame[frame.kind != "null"], frame[frame.kind == "null"]
    least = pd.cut(hides.z, EDGES, right=False, labels=EDGES[:-1]).astype(float)
    return {
        "kind": pd.crosstab(frame.kind, frame.outcome).reset_index(),
        "z": pd.crosstab([hides.kind, least.rename("z from")], hides.outcome).reset_index(),
        "robot": pd.crosstab(frame.robot, frame.outcome).reset_index(),
        "card": pd.crosstab(nulls.robot, nulls.card.rename("card")).reset_index(),
        "lost": count_losses(frame),
    }  # fmt: skip


def find_failures(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the cases that fail a limit, by kind, outcome and z."""
    fine = _right(frame) | frame.outcome.isin(["silent", "described"]) & (frame.wrong == "")
    fine &= frame.card != "missing"
    fine &= ~((frame.said != "") & ~(frame.after < frame.before))
    return frame[~fine].sort_values(["kind", "outcome", "z"])


def show(frame: pd.DataFrame, out: Path, told: str) -> None:
    """Print the tables and failures, write them with all cases as JSON and as a page."""
    rows, counts = check(frame), count(frame)
    for r in rows:
        text = "no cases"
        if r["of"]:
            text = f"{r['hits']:3d} of {r['of']:3d}  {r['share']:.2f} [{r['low']:.2f}, {r['high']:.2f}]"  # noqa: E501
            verdict = {True: "holds", False: "FAILS", None: ""}[r["holds"]]
            text += f"  {r['need']} {verdict}".rstrip()
        print(f"{r['what']:55s} {text}")
    for table in counts.values():
        print(table.to_string(index=False))
    spent = f"processor time a case: median {frame.seconds.median():.1f} s, most {frame.seconds.max():.1f} s"  # noqa: E501
    print(spent)
    failures = find_failures(frame)
    for f in failures.itertuples():
        print(f"{f.case[13:]} {f.robot}: {f.hidden or 'nothing'} (z {f.z:.1f}, "
              f"{f.z_measured:.1f}): {f.outcome} [{f.said}] refuted [{f.refuted}] {f.card} "
              f"{f.before:.4f} → {f.after:.4f}")  # fmt: skip
    failed = [r["what"] for r in rows if r.get("holds") is False]
    verdict = f"Not met: {'; '.join(failed)}." if failed else "All that was asked for holds."
    statement = f"{len(frame)} cases, {told}. {verdict}"
    trials = frame.drop(columns=["named", "lost"], errors="ignore")
    data = {"schema": "identifiability/study/hidden-physics/1", "statement": statement,
            "checks": rows, "trials": trials.to_dict("records")}  # fmt: skip
    write_json(out, plain(data))
    table = pd.DataFrame([
        {"what": r["what"], "of": f"{r['hits']} of {r['of']}",
         "share": check_cell(
             f"{100 * r['share']:.0f} % ({100 * r['low']:.0f} … {100 * r['high']:.0f})",
                        r["holds"], r["need"]) if r["of"] else "–"}
        for r in rows
    ])  # fmt: skip
    columns = ["case", "robot", "hidden", "z", "z_measured", "outcome", "said", "refuted", "card",
               "before", "after"]  # fmt: skip
    shown = {"z": 1, "z_measured": 1, "before": 4, "after": 4}
    sections = (
        Section("checks", "What must hold", spent, (frame_table(table),)),
        Section("counts", "Outcomes", "By kind, by z of the oracle, by robot; cards of nulls; to "
                "what effects of z ≥ 5 that were not named lost their evidence.",
                tuple(frame_table(t) for t in counts.values())),
        Section("failures", "Failures", "", (frame_table(failures[columns].round(shown)),)),
        Section("cases", "Cases", "", (frame_table(trials[columns].round(shown)),)),
        Section("method", "Method", "", (Prose((str(__doc__).partition("\n\n")[2],)),)),
    )  # fmt: skip
    page = out.with_suffix(".html")
    print(
        write_page("Hidden effects, another physics", statement, sections, page, overline="Study")
    )


def stream_of(commit: str) -> str:
    """Return the stream of a commit, which must be the one that is checked out.

    Raises
    ------
    IdentifiabilityError
    """
    ask = ["git", "-C", str(ROOT), "rev-parse", "--verify", f"{commit}^{{commit}}"]
    found = subprocess.run(ask, capture_output=True, text=True, check=False)
    whole = found.stdout.strip()
    same = ["git", "-C", str(ROOT), "diff", "--quiet", whole, "--", "identifiability", "studies"]
    if found.returncode or subprocess.run(same, check=False).returncode:
        raise IdentifiabilityError(
            f"The checkout is not that of the commit '{commit}'; check it out before it is judged."
        )
    return whole


def main(argv: Sequence[str] | None = None) -> None:
    """Run the cases that are missing, and print the table."""
    parser = study_parser("hidden_physics", __doc__, "two cases")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--commit", help="the commit that is judged; its hash draws the cases")
    which.add_argument("--stream", default="0", help="seeds of the cases; 0 while developing")
    which.add_argument("--rows", type=Path, nargs="+", help="files of cases; runs nothing")
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", choices=sorted(set(KINDS)), help="make all of one kind")
    parser.add_argument("--folder", type=Path, default=ROOT / "reports" / "cases",
                        help="scratch folder of the cases")  # fmt: skip
    asked = parser.parse_args(argv)
    asked.cases = 2 if asked.quick else asked.cases
    out = asked.out
    out.parent.mkdir(parents=True, exist_ok=True)
    if asked.rows:
        frame = pd.DataFrame([r for path in asked.rows for r in read_rows(path)])
        frame = frame.sort_values("number")
        show(frame, out, f"stream {', '.join(sorted({c[:12] for c in frame.case}))}")
        return
    stream = stream_of(asked.commit) if asked.commit else asked.stream
    done = {r["case"] for r in read_rows(out.with_suffix(".jsonl"))}
    for number in range(asked.first, asked.first + asked.cases):
        path = make_case(asked.folder, stream, number, asked.only)
        if path.name in done:
            continue
        row = examine(path)
        with out.with_suffix(".jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(plain(row)) + "\n")
        print(f"{row['case']} {row['robot']}: {row['hidden']} (z {row['z']:.1f}): {row['outcome']} "
              f"[{row['said']}] {row['before']:.4f} → {row['after']:.4f}, {row['seconds']:.1f} s",
              flush=True)  # fmt: skip
    told = f"drawn by commit {stream}" if asked.commit else f"stream {stream}"
    show(pd.DataFrame(read_rows(out.with_suffix(".jsonl"))), out, told)


if __name__ == "__main__":
    main()
