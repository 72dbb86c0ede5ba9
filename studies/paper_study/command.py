"""Run studies: one as a script, several from `identifiability paper`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

from identifiability.foundation.engines.local import Engine, Serial, choose_engine
from paper_study.index import write_index
from paper_study.page import write_study
from paper_study.result import Progress, StudyResult
from paper_study.subject import SHIPPED

#: The checkout.
ROOT = Path(__file__).resolve().parents[2]

#: Studies in the order of the index: module → what they are called on the command line.
STUDIES = {
    "table_1_base_parameters": ("1", "table1"),
    "table_2_model_1": ("2", "table2"),
    "table_3_noise": ("3", "table3"),
    "figure_4_noise_levels": ("figure4", "fig4"),
    "table_4_stribeck": ("4", "table4"),
    "table_5_passive_friction": ("5", "table5"),
    "table_6_no_actuators": ("6", "table6"),
    "figure_5_split_forces": ("figure5", "fig5"),
    "figure_3_forces": ("figure3", "fig3"),
    "table_7_stand_in": ("7", "table7"),
    "table_8_stand_in": ("8", "table8"),
    "figure_6_held_out": ("figure6", "fig6"),
    "paper_slips": ("slips",),
}


@dataclass(frozen=True)
class Options:
    """How studies are run.

    Attributes
    ----------
    quick : bool
        Few seeds and coarse grids.
    seeds : int or None
        Trials of every case; None for 40, or 4 if quick.
    engine : Engine
        Where trials run.
    robot : str
        Shipped name or file.
    progress : callable(str, float) or None
    """

    quick: bool = False
    seeds: int | None = None
    engine: Engine = field(default_factory=Serial)
    robot: str = SHIPPED
    progress: Progress | None = None

    @property
    def draws(self) -> int:
        """Trials of a case."""
        return self.seeds or (4 if self.quick else 40)

    def fewer(self, full: int, quick: int) -> int:
        """Return a smaller number of trials, for wide grids."""
        return min(self.draws, quick if self.quick else full)

    def say(self, text: str, share: float) -> None:
        """Show progress."""
        if self.progress:
            self.progress(text, share)

    def part(self, text: str, start: float, stop: float) -> Options:
        """Return the options for a part of the work, whose progress is shown between two shares."""
        if self.progress is None:
            return self
        whole = self.progress
        return replace(
            self, progress=lambda _what, share: whole(text, start + share * (stop - start))
        )


Run = Callable[[Options], StudyResult]


def find_studies(words: Sequence[str]) -> list[str]:
    """Return the studies that some words name; all of them for no words.

    Raises
    ------
    KeyError
        With a sentence, if a word names none.
    """
    if not words:
        return list(STUDIES)
    chosen = []
    for word in words:
        plain = word.lower().removesuffix(".py").replace(" ", "").replace("-", "_")
        key = plain.replace("table_", "table").replace("figure_", "figure")
        found = [n for n, short in STUDIES.items() if plain == n or key in short]
        if not found:
            raise KeyError(
                f"There is no study '{word}'. The studies are {', '.join(STUDIES)}; short names "
                f"such as 3, table3 and figure4 will do."
            )
        chosen += [n for n in found if n not in chosen]
    return chosen


def run_studies(names: Sequence[str], options: Options, out: Path) -> list[StudyResult]:
    """Run studies, write their pages and the index."""
    results = []
    for k, name in enumerate(names):
        run: Run = import_module(name).run
        share = (k / len(names), (k + 1) / len(names))
        options.say(name, share[0])
        result = run(options.part(name, *share))
        write_study(result, out)
        results.append(result)
    write_index(out)
    return results


def print_result(result: StudyResult, out: Path) -> None:
    """Print the statement, what failed, and where the page is."""
    mark = "pass" if result.passed else "FAIL"
    print(f"{mark}  {result.title}: {result.summary}\n      {result.statement}")
    for check in result.failed:
        print(f"      ✕ {check.name}: {check.ours}, wanted {check.tolerance}")
    print(f"      {out / result.name}.html")


def run_script(run: Run, argv: Sequence[str] | None = None) -> None:
    """Run one study from the command line; exit with 1 if a required check fails."""
    module = sys.modules[run.__module__]
    parser = argparse.ArgumentParser(
        description=module.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few seeds")
    parser.add_argument("--seeds", type=int, help="trials of every case (40; 4 if quick)")
    parser.add_argument("--engine", help="serial, processes (default) or dask")
    parser.add_argument("--workers", type=int, help="processes (one a core)")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    parser.add_argument("--resume", type=Path, help="folder that keeps finished work")
    parser.add_argument("--out", type=Path, default=ROOT / "reports", help="folder (reports)")
    given = parser.parse_args(argv)
    if given.seeds is not None and given.seeds < 1:
        parser.error("--seeds must be at least 1")
    from identifiability.cli.common import progress, sentences  # noqa: PLC0415 - quick --help

    chosen = (given.engine, given.workers, given.scheduler, given.resume)
    with sentences(), progress() as say, choose_engine(*chosen) as engine:
        options = Options(given.quick, given.seeds, engine, progress=say)
        result = run(options)
        write_study(result, given.out)
        write_index(given.out)
    print_result(result, given.out)
    sys.exit(0 if result.passed else 1)
