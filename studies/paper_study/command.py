"""Run studies: one as a script, several from `identifiability paper`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import cloudpickle
from registry import STUDIES, Study
from shared import ROOT

import paper_study
from identifiability.cli.common import progress, sentences
from identifiability.cli.options import Place
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.errors import IdentifiabilityError
from paper_study.index import write_index
from paper_study.page import write_study
from paper_study.result import Progress, StudyResult
from paper_study.subject import SHIPPED

# Workers of a cluster do not have the studies.
cloudpickle.register_pickle_by_value(paper_study)


@dataclass(frozen=True)
class Options:
    """How studies are run.

    Attributes
    ----------
    quick : bool
        Few seeds and coarse grids.
    seeds : int or None
        Trials of every case; None for the default.
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
        return self.seeds or (DEFAULTS.draws_quick if self.quick else DEFAULTS.draws)

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


def find_studies(words: Sequence[str]) -> list[Study]:
    """Return the studies that some words name; those of the paper for no words.

    Raises
    ------
    IdentifiabilityError
        If a word names none.
    """
    if not words:
        return [s for s in STUDIES if s.paper]
    chosen = []
    for word in words:
        plain = word.lower().removesuffix(".py").replace(" ", "").replace("-", "_")
        key = plain.replace("table_", "table").replace("figure_", "figure")
        found = [s for s in STUDIES if plain == s.name or key in s.words]
        if not found:
            raise IdentifiabilityError(
                f"There is no study '{word}'. The studies are "
                f"{', '.join(s.name for s in STUDIES)}; short names such as 3, table3 and figure4 "
                f"will do."
            )
        chosen += [s for s in found if s not in chosen]
    return chosen


def run_studies(names: Sequence[str], options: Options, out: Path) -> list[StudyResult]:
    """Run studies of the paper, and write their pages."""
    results = []
    for k, name in enumerate(names):
        run: Run = import_module(name).run
        share = (k / len(names), (k + 1) / len(names))
        options.say(name, share[0])
        result = run(options.part(name, *share))
        write_study(result, out)
        results.append(result)
    return results


def print_result(result: StudyResult, out: Path) -> None:
    """Print the statement, the failed checks, and the path of the page."""
    mark = "pass" if result.passed else "FAIL"
    print(f"{mark}  {result.title}: {result.summary}\n      {result.statement}")
    for check in result.failed:
        print(f"      ✕ {check.name}: {check.ours}, wanted {check.tolerance}")
    print(f"      {out / result.name}.html")


def main(argv: Sequence[str], place: Place | None = None) -> int:
    """Run studies from the command line; return 1 if a required check of the paper fails.

    Parameters
    ----------
    argv : sequence of str
    place : Place, optional
        Where trials run; processes of this machine by default.
    """
    parser = argparse.ArgumentParser(prog="studies", description="Run studies by the registry.")
    parser.add_argument("names", nargs="*", help="such as 3, figure4, coverage (the paper's)")
    parser.add_argument("--quick", action="store_true", help="in short: few seeds, coarse grids")
    draws = f"trials of every case ({DEFAULTS.draws}; {DEFAULTS.draws_quick} if quick)"
    parser.add_argument("--seeds", type=int, help=draws)
    parser.add_argument("--workers", type=int, help="processes (one a core)")
    parser.add_argument("--out", type=Path, default=ROOT / "reports", help="folder (reports)")
    given = parser.parse_args(argv)
    if given.seeds is not None and given.seeds < 1:
        parser.error("--seeds must be at least 1")
    place = place or Place(workers=given.workers)
    with sentences():
        studies = find_studies(given.names)
        paper = [s.module for s in studies if s.paper]
        results: list[StudyResult] = []
        if paper:
            with progress() as say, place.running() as engine:
                options = Options(given.quick, given.seeds, engine, progress=say)
                results = run_studies(paper, options, given.out)
        for study in studies:
            if not study.paper:
                words = study.quick.split() if given.quick else []
                words += ["--out", str(given.out / f"{study.name}.json")]
                import_module(study.module).main(words)
        index = write_index(given.out)
    for result in results:
        print_result(result, given.out)
    print(index)
    return 0 if all(r.passed for r in results) else 1


def run_script(run: Run) -> None:
    """Run one study of the paper as a script."""
    name = Path(str(sys.modules[run.__module__].__file__)).stem
    sys.exit(main([name, *sys.argv[1:]]))
