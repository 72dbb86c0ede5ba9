"""``identifiability predict``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command(motion_alone=True)
def predict(
    machine: options.Machine,
    recorded: options.Recorded,
    result: options.JsonResult,
    logs: options.Logs,
    outputs: options.Outputs,
    out: Annotated[Path | None, Option(), Writes(".csv", ".parquet", ".pq")] = None,
) -> None:
    """Predict the torque of logs with a fitted model, sample by sample, with intervals.

    **You give** the robot, the JSON that analyze, prune or diagnose wrote, and other logs. **You
    get** the error of each joint, the share of samples that lie in their intervals (95 % would be
    right), and with --out a table.

    The logs are prepared as the fitted ones were, with the same cut-off. A column of the file has
    the name of a joint and of what it holds: measured torque (`tau`, and `tau_raw` as it was
    measured, not low-passed), `predicted`, `residual` and `residual_raw`, the 95 % interval of the
    model's torque (`mean_from`, `mean_to`) and those of a new sample (`from`, `to`, `raw_from`,
    `raw_to`). They know what the fitted logs did not tell of the parameters, and how far torque
    scatters about the model on motion that it has not seen.

        identifiability analyze 3-rps run.csv --json result.json
        identifiability predict 3-rps result.json other.csv --out torque.csv --report torque.html

    Parameters
    ----------
    result
        JSON that analyze, prune or diagnose wrote.
    logs
        Logs to predict, with columns as for analyze; those of torque may be missing.
    out
        File to write: .csv or .parquet.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.predict import read_fit  # noqa: PLC0415

        say("reading the result", 0.0)
        fit = read_fit(result, machine.load(recorded))
        say("predicting torque", 0.2)
        found = fit.predict(logs)
        written = outputs.write(found, say, (found.write, out))
    common.print_result(found, [found.statement], written, "Predicted torque by joint")
