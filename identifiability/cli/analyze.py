"""``identifiability analyze``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.cli import common, options
from identifiability.foundation.options import NotNegative, Replicates, Seed

if TYPE_CHECKING:
    from identifiability.workflows.analyze import Analysis


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
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            progress=say,
            engine=place.stated(runner),
            preparation=derived.preparation(),
            **vars(own),
        )
        written = outputs.write(result, say)
    print_analysis(result, written)


def print_analysis(result: Analysis, written: Sequence[Path]) -> None:
    """Print the ladder, the errors, the statement, what to do next, the paths of what is there."""
    title = f"{result.robot.title}: models (▸ use this one)"
    first, *hints = common.apart(result.statement, result.hints)
    texts = filter(None, [first, result.mass_statement, *hints])
    common.print_result(result, texts, written, title)
