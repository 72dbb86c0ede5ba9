"""``identifiability prune``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import (
    NotNegative,
    Positive,
    PruneCriterion,
    Replicates,
    Seed,
)

if TYPE_CHECKING:
    from identifiability.workflows.prune import Ladder


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    validate: Annotated[Sequence[str], "Logs held out, which are only reported on."] = ()
    ladder: Annotated[
        options.Ladder,
        "TOML whose first model is where pruning starts; by default every base parameter, with "
        "torque offsets.",
    ] = None
    forbid: Annotated[Sequence[str], "Parameters that must not be dropped."] = ()
    force: Annotated[Sequence[str], "Parameters that are dropped whatever the data say."] = ()
    criterion: Annotated[
        PruneCriterion,
        "How much of what the best model predicts a smaller one may cost; by default 2 nats.",
    ] = "identifiable"
    propose: Annotated[bool, "Try symmetries that the robot's kinematics suggest."] = True
    reach: Annotated[Positive, "Does nothing any more; other values than 1 are noted."] = 1.0
    method: options.Method = "wls"
    estimator: options.Estimator = "auto"
    replicates: Annotated[
        Replicates | None,
        "Resampled logs on which the pruning is repeated; by default 200, or 20 if `quick`.",
    ] = None
    cad_prior: Annotated[NotNegative | None, "As for `analyze`."] = None
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
    out: Annotated[
        Path | None,
        "Write the chosen model here, as a model file for every other verb.",
        Writes(".toml"),
    ] = None,
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
    stability = [] if result.nothing else [result.stability.statement]
    masses = filter(None, [result.mass_statement])
    texts = [result.statement, *masses, *stability]
    common.print_result(result, texts, written, title, result.selected + 4)
