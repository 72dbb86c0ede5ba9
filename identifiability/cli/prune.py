"""``identifiability prune``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import NotNegative, Replicates, Seed

if TYPE_CHECKING:
    from identifiability.workflows.prune import Ladder


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    validate: Sequence[str] = ()
    ladder: options.Ladder = None
    forbid: Sequence[str] = ()
    force: Sequence[str] = ()
    method: options.Method = "wls"
    estimator: options.Estimator = "auto"
    replicates: Replicates | None = None
    cad_prior: NotNegative | None = None
    prior: options.Prior = None
    seed: Seed = 0
    quick: options.Quick = False


@options.command()
def prune(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
    out: Annotated[Path | None, Writes(".toml")] = None,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.prune import prune as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            progress=say,
            engine=runner,
            preparation=derived.preparation(),
            **vars(own),
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
    print_pruning(result, written)


def print_pruning(result: Ladder, written: Sequence[Path]) -> None:
    """Print the ladder about the model to use, the statement, the paths of what was written."""
    title = f"{result.robot.title}: reduction path (▸ use this model)"
    masses = filter(None, [result.mass_statement])
    texts = [result.statement, *masses]
    common.print_result(result, texts, written, title, result.selected + 4)
