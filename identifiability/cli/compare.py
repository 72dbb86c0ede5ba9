"""``identifiability compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from identifiability.cli import common, options


@options.command("workflows/compare.py")
def compare(
    machine: options.Machine,
    recorded: options.Recorded,
    before: Annotated[str, Argument()],
    after: Annotated[str, Argument()],
    derived: options.Derived,
    outputs: options.Outputs,
    more_before: Annotated[list[str] | None, Option("--before", metavar="LOG")] = None,
    more_after: Annotated[list[str] | None, Option("--after", metavar="LOG")] = None,
    **own: Any,
) -> None:
    """Say what changed between two logs, or two results, of one robot.

    **You give** a log or a result (.json) of before and one of after; *--before* and *--after* add
    logs. Logs of the same motion are best: they are compared sample by sample, so that what the
    model gets wrong cancels; logs of other motions by a fit to each side; results by their values.

        identifiability compare arm.urdf monday.csv friday.csv --report changed.html
        identifiability compare arm.urdf a.csv c.csv --before b.csv --after d.csv
        identifiability compare arm.urdf old.json new.json

    **You get** what changed, with a 95 % interval and p: friction of a joint and by how many
    percent, a load on a body, an offset of torque, rotor inertia, any other value. All of them
    together are tested at a level of 5 %, so "nothing changed" is wrong in one case of twenty when
    nothing did; the last sentence says from which size on a change would have been found.

    Parameters
    ----------
    more_before
        Another log of before; may be given several times.
    more_after
        Another log of after; may be given several times.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.workflows.compare import compare as find  # noqa: PLC0415

        first, second = [before, *(more_before or [])], [after, *(more_after or [])]
        say("reading logs", 0.0)
        sides = []
        for side in (first, second):
            results = [path for path in side if Path(path).suffix.lower() == ".json"]
            if results and len(side) > 1:
                raise OptionError(
                    f"{results[0]} is a result, and stands beside others; give one result on each "
                    "side, or logs alone."
                )
            sides.append(side[0] if results else side)
        say("comparing", 0.3)
        found = find(machine.load(recorded), *sides, preparation=derived.preparation(), **own)
        written = outputs.write(found, say)
    common.print_end([found.answer])
    rest = [found.statement.removeprefix(found.answer).strip()]
    common.print_result(found, rest, written)
