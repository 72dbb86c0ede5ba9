"""``identifiability prune``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

if TYPE_CHECKING:
    from identifiability.workflows.prune import Ladder


@options.command("workflows/prune/workflow.py")
def prune(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    out: Annotated[Path | None, Option(), Writes(".toml")] = None,
    **own: Any,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone.

    **You give** a robot file and logs, as for *analyze*. Stretches of the logs, or the logs in
    turn, are held out to judge each step; what you hold back with --validate is only reported on.

    **You get** the reduction path, a row a model (▸ the one to use): what was left out, tied or
    merged, and why; the error on unseen motion ± its standard error; how many resampled logs lead
    to the same model. Few lead there? Then several models are as good, and which one is chance.

    **Then** use the model that --out wrote:

        identifiability prune 3-rps run.csv --report pruning.html --out pruned.toml
        identifiability analyze 3-rps run.csv --ladder pruned.toml
        identifiability prune arm.urdf a.csv b.csv --forbid joint_1.Fv --criterion one-se

    It takes some times longer than *analyze*; --quick resamples a tenth as often.

    Parameters
    ----------
    out
        Write the chosen model here, as a model file for every other verb.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.prune import prune as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            progress=say,
            engine=runner,
            preparation=derived.preparation(),
            **own,
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
