"""``identifiability inspect``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

if TYPE_CHECKING:
    from identifiability.workflows.inspect import Inspection


@options.command("workflows/inspect.py")
def inspect(
    machine: options.Machine,
    recorded: options.Recorded,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    logs: Annotated[list[str] | None, Argument()] = None,
    template: Annotated[Path | None, Option(), Writes(".csv")] = None,
    **own: Any,
) -> None:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd about them.

    **Without logs**: the joints and which of them have motors, the columns that a log must have,
    the base parameters, and what only a sidecar can say. **With logs**: rates, gaps, resolution,
    bandwidth, saturation, the size of the torque beside that which the file's masses ask for, and
    whatever contradicts robot file, limits or physics; the page draws every joint over time.

        identifiability inspect 3-rps
        identifiability inspect arm.urdf --template log.csv
        identifiability inspect arm.urdf run.csv --report inspection.html

    Look here first when a log does not get in, or when *analyze* answers what you do not believe.

    Parameters
    ----------
    logs
        Logs to look at, in any form that analyze reads.
    template
        CSV to write with the columns that a log must have.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.inspect import inspect as run  # noqa: PLC0415

        given = logs or []
        result = run(
            machine.load(recorded),
            given,
            preparation=derived.preparation(),
            progress=say,
            engine=runner if any(astuple(place)) else None,
            **own,
        )
        written = [result.write_template(template)] if template is not None else []
        written += outputs.write(result, say)
    print_inspection(result, written)


def print_inspection(result: Inspection, written: Iterable[Path]) -> None:
    """Print the joints, or what the logs hold of them, then what is odd, and the paths."""
    if result.records:
        _print_logs(result)
        hints = result.hints
    else:
        _print_joints(result)
        hints = tuple(f"{n.text} {n.line}".strip().replace("\n", " ") for n in result.needs)
    common.print_end([result.statement, *hints], written)


def _print_joints(result: Inspection) -> None:
    rows = [
        (
            j.name,
            f"{j.role} {j.remark}".strip(),
            j.kind or "—",
            f"{_number(j.low)} … {_number(j.high)} {j.unit}" if math.isfinite(j.low) else "—",
            _number(j.speed),
        )
        for j in result.joints
    ]
    headings = ("joint", "is", "kind", "limits", "speed")
    common.print_table(f"{result.robot.title}: joints", headings, rows, left=headings[:3])


def _print_logs(result: Inspection) -> None:
    rows = [
        (
            r.name,
            str(r.samples),
            f"{r.duration:.4g}",
            f"{r.rate:.4g}",
            common.percent(r.jitter, 1),
            str(r.gaps),
            "—" if r.cutoff is None else f"{r.cutoff:.3g}",
            str(r.outputs) if not r.refused else "refused",
        )
        for r in result.records
    ]
    headings = ("log", "samples", "s", "Hz", "jitter", "gaps", "cut-off Hz", "left")
    common.print_table(f"{result.robot.title}: logs", headings, rows, left=("log",))
    joints: list[tuple[str, ...]] = []
    for r in result.records:
        joints += [
            (
                j.joint,
                f"{j.low:.2g} … {j.high:.2g}",
                _number(j.speed),
                _number(j.bandwidth),
                _number(j.step) if j.step else "fine",
                _number(max(abs(j.torque_low), abs(j.torque_high))),
                _number(j.scale),
            )
            for j in r.joints
        ]
        joints.append(())
    own = ("joint", "position", "speed", "band Hz", "step", "torque", "× file's")
    common.print_table("What they hold of each joint", own, joints, left=("joint",))


def _number(x: float) -> str:
    return f"{x:.3g}" if math.isfinite(x) else "—"
