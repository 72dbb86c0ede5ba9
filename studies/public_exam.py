"""The public exam: which tool errs least on unseen motion, and whose intervals hold the truth?

Every tool answers every case in a process of one thread (`docs/reference/exam.md`). Errors are the
rms of raw torque, or of positions of robots that commands drive, on held-out logs. They are
relative to the rms of what is predicted. Intervals and called values are compared with planted
truth. Tools run with the settings that their documentation recommends; a refusal states its reason.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from exam.cases import CASES
from exam.contract import run_tool
from exam.score import Case, score
from shared import ROOT, study_parser, write_answer

#: Tools that enter, and the variable with the interpreter of a tool's environment.
TOOLS = ("ours", "least_squares", "figaroh_qr")
PYTHON = "TOOL_PYTHON"

#: Cases of a run in short.
QUICK = ("plain", "exchanged", "servos")

#: Least share of the cases in which our error is the smallest, and bounds of coverage.
SMALLEST, COVERAGE = 10 / 12, (0.93, 0.97)

#: Errors that differ by less than this share are equal.
EQUAL = 1.01


def run_exam(
    tools: Sequence[Path], names: Sequence[str], cache: Path, data: Path | None, python: str
) -> pd.DataFrame:
    """Return one row a case and tool."""
    rows: list[dict[str, Any]] = []
    for source in CASES:
        folder = source.make(cache, data) if source.name in names else None
        if folder is None:
            continue
        case = Case.read(folder)
        for adapter in tools:
            out = cache / "answers" / source.name / adapter.stem
            other = find_python(adapter.stem, python)
            run = run_tool(adapter, folder.resolve(), out.resolve(), other)
            rows.append({"case": source.name, "tool": adapter.stem, **score(case, run, out)})
            print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def find_python(tool: str, given: str) -> str:
    """Return the interpreter of a tool: as given, `FIGAROH_PYTHON` and the like, or this one."""
    variable = f"{tool.partition('_')[0].upper()}_PYTHON"
    return given or os.environ.get(variable) or os.environ.get(PYTHON) or sys.executable


def summarize(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row a tool: cases with the smallest error, coverage, names and costs."""
    best = frame.groupby("case")["error [%]"].min()
    rows = []
    for tool, part in frame.groupby("tool", sort=False):
        least = part["error [%]"] <= EQUAL * part["case"].map(best)
        row = {
            "tool": tool,
            "cases": len(part),
            "answered": int((part["status"] == "answered").sum()),
        }
        row["smallest error"] = int(least.sum())
        for share, count in (("coverage", "intervals"), ("called right", "called")):
            scored = part.dropna(subset=[share, count]) if {share, count} <= {*part} else part[:0]
            total = float(scored[count].sum()) if len(scored) else 0.0
            row[share] = (
                float((scored[share] * scored[count]).sum() / total) if total else float("nan")
            )
        for name in ("hidden", "named right", "named wrong"):
            row[name] = int(part[name].sum()) if name in part else 0
        row["processor [s]"] = float(part["processor [s]"].sum())
        row["most memory [MB]"] = float(part["memory [MB]"].max())
        rows.append(row)
    return pd.DataFrame(rows)


def losses(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the cases in which another tool errs less than ours, with both errors."""
    table = frame.pivot(index="case", columns="tool", values="error [%]")
    others = table.drop(columns="ours")
    found = table.index[others.min(axis=1) * EQUAL < table["ours"].fillna(float("inf"))]
    return pd.DataFrame(
        [
            {"case": c, "ours [%]": table["ours"][c], "best": others.loc[c].idxmin(),
             "its error [%]": others.loc[c].min()}
            for c in found
        ]
    )  # fmt: skip


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the exam, print its table and write its files."""
    parser = study_parser("exam", __doc__, "three cases, ours and least squares")
    parser.add_argument("--tool", nargs="+", default=None, help="names, or paths of adapters")
    parser.add_argument("--only", nargs="+", default=[c.name for c in CASES], help="cases")
    parser.add_argument("--python", default="", help="interpreter of the tools' environment")
    parser.add_argument("--cache", type=Path, default=ROOT / ".cache" / "exam")
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    asked = parser.parse_args(argv)
    named = asked.tool or (TOOLS[:2] if asked.quick else TOOLS)
    folder = Path(__file__).parent / "exam" / "adapters"
    tools = [Path(t) if t.endswith(".py") else folder / f"{t}.py" for t in named]
    names = QUICK if asked.quick else asked.only
    frame = run_exam(tools, names, asked.cache, asked.data, asked.python)
    table = summarize(frame)
    print(table.round(3).to_string(index=False))
    tables = {"Tools": table, "Cases": frame}
    if "ours" in set(frame["tool"]):
        tables["Where others are better"] = losses(frame)
    statement = f"{len(tools)} tools answered {frame['case'].nunique()} cases."
    write_answer(asked.out, "The public exam", statement, tables, __doc__)
    return frame


if __name__ == "__main__":
    main()
