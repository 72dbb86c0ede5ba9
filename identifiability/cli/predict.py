"""``identifiability predict``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from identifiability.cli import common, options
from identifiability.cli.common import Reads


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    forward: bool = False


@options.command(motion_alone=True)
def predict(
    machine: options.Machine,
    recorded: options.Recorded,
    result: Annotated[str, Reads("result", "JSON", always=False)],
    logs: list[str],
    outputs: options.Outputs,
    own: Options,
    out: Annotated[Path | None, options.Table] = None,
) -> None:
    """Predict the torque of logs with a fitted model, or where they move its robot."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.predict import predict as run  # noqa: PLC0415

        say("reading the result", 0.0)
        robot = machine.load(recorded)
        say("predicting", 0.2)
        found = run(robot, result, logs, **vars(own))
        written = outputs.write(found, say, (found.write, out))
    what = "Error of positions (rms)" if own.forward else "Predicted torque by joint"
    common.print_result(found, [found.statement, *found.hints], written, what)
