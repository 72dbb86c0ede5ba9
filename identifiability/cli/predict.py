"""``identifiability predict``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from identifiability.cli import common, options


@options.command(motion_alone=True)
def predict(
    machine: options.Machine,
    recorded: options.Recorded,
    result: options.JsonResult,
    logs: list[str],
    outputs: options.Outputs,
    out: Annotated[Path | None, options.Table] = None,
) -> None:
    """Predict the torque of logs with a fitted model, sample by sample, with intervals."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.predict import read_fit  # noqa: PLC0415

        say("reading the result", 0.0)
        fit = read_fit(result, machine.load(recorded))
        say("predicting torque", 0.2)
        found = fit.predict(logs)
        written = outputs.write(found, say, (found.write, out))
    common.print_result(
        found, [found.statement, *found.hints], written, "Predicted torque by joint"
    )
