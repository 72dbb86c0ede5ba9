"""``identifiability payload``."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options


@options.command
def payload(
    machine: options.Machine,
    recorded: options.Recorded,
    result: Path,
    logs: options.Logs,
    outputs: options.Outputs,
    without: Annotated[list[str] | None, Option()] = None,
    body: str | None = None,
) -> None:
    """Weigh what hangs on a body: its mass, centre and inertia, with intervals.

    The result is of the robot without the load; the logs are with it. Every interval holds what
    the result does not know of the robot and what the noise of these logs remembers; with several
    logs, also how they scatter. A log of the same motion without the load, best of the same day
    (`--without`), is compared with it sample by sample, so that what the model gets wrong cancels.

    ```
    identifiability analyze arm.urdf empty.csv --json result.json
    identifiability payload arm.urdf result.json loaded.csv --without unloaded.csv
    ```

    Parameters
    ----------
    result
        JSON that analyze, prune or diagnose wrote, of logs without the load.
    logs
        Logs with the load, with columns as for analyze.
    without
        Log without the load, best along the same motion; may be given several times.
    body
        Which carries the load; default: the last of a chain, or the platform.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.measured import measured  # noqa: PLC0415
        from identifiability.workflows.payload import payload as weigh  # noqa: PLC0415

        files = [*machine.files, result, *logs, *(without or [])]
        common.check_outputs(*astuple(outputs), inputs=files)
        say("reading logs", 0.0)
        found = weigh(machine.load(recorded), result, logs, without or [], body=body)
        written = outputs.write(found, say)
    common.print_end([found.answer])
    headings = ("quantity", "value", "unit", "from", "to", "told")
    rows = [
        (
            q.name,
            measured(q.value, q.half) if q.told else f"{q.value:.3g}",
            q.unit,
            f"{q.low:.3g}",
            f"{q.high:.3g}",
            "yes" if q.told else q.why,
        )
        for q in found.quantities
    ]
    title = f"What hangs on {found.body}; moments about its centre"
    common.print_table(title, headings, rows, left=("quantity", "unit", "told"))
    common.print_end([found.statement.removeprefix(found.answer).strip()], written)
