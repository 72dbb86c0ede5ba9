"""``identifiability analyze``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option

from identifiability.cli import common, options
from identifiability.foundation.options import NotNegative, OptionError, Replicates, Seed

if TYPE_CHECKING:
    from identifiability.workflows.analyze import Analysis


@dataclass(frozen=True)
class Machine(options.Machine):
    """The robot; of many robots a folder each."""

    robot: Annotated[str, Argument(autocompletion=options.find_robots)] = ""


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    validate: Sequence[str] = ()
    ladder: options.Ladder = None
    method: options.Method = "wls"
    estimator: options.Estimator = "auto"
    replicates: Replicates | None = None
    posterior: bool = False
    cad_prior: NotNegative | None = None
    prior: options.Prior = None
    seed: Seed = 0
    quick: options.Quick = False


@options.command()
def analyze(
    machine: Machine,
    recorded: options.Recorded,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
    logs: Annotated[Sequence[str], Argument()] = (),
    each: Annotated[Sequence[str], Option(metavar="FOLDER")] = (),
    out: Annotated[Path | None, common.Writes()] = None,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        said: dict[str, Any] = {"engine": place.stated(runner), "progress": say}
        said |= {**vars(own), "preparation": derived.preparation()}
        if each:
            one = (machine, recorded, outputs, list(logs), list(said.pop("validate")))
            if one != (Machine(), options.Recorded(), options.Outputs(), [], []) or out is None:
                raise OptionError(
                    "--each takes robots, logs and what is said of them from the folders and the "
                    "sidecars in them; give --out and how to fit beside it: identifiability "
                    "analyze --each FOLDER --each FOLDER --out RESULTS."
                )
            from identifiability.workflows.many import analyze_many  # noqa: PLC0415

            fleet = analyze_many(each, out, **said)
        elif not logs or out is not None:
            raise OptionError(
                "Give a robot and its logs, or folders of several robots with --each, and --out: "
                "identifiability analyze ROBOT LOG, or identifiability analyze --each FOLDER "
                "--out RESULTS."
            )
        else:
            from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

            result = run(machine.load(recorded), logs, **said)
            written = outputs.write(result, say)
    if not each:
        print_analysis(result, written)
        return
    common.print_result(fleet, [fleet.statement], fleet.files, f"{fleet.heading[0]}: analyze")
    if fleet.failed:
        raise Exit(1)


def print_analysis(result: Analysis, written: Sequence[Path]) -> None:
    """Print the ladder, the errors, the statement, what to do next, the paths of what is there."""
    title = f"{result.robot.title}: models (▸ use this one)"
    first, *hints = common.apart(result.statement, result.hints)
    texts = filter(None, [first, result.mass_statement, *hints])
    common.print_result(result, texts, written, title)
