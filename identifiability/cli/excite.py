"""``identifiability excite``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import (
    Count,
    Duration,
    Harmonics,
    LimitShare,
    Seed,
    counted,
    within,
)

if TYPE_CHECKING:
    from identifiability.workflows.excite import Excitation


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    harmonics: Harmonics = 5
    at_rest: bool = False
    duration: Duration | None = None
    samples: int = 750
    limits: options.Limits = None
    parameters: Annotated[Sequence[str] | None, Option("--parameter")] = None
    model: options.Model = None
    start_from: Sequence[str] | None = None
    separate: Sequence[str] | None = None
    evaluations: Count = 15_000
    seed: Seed = 0


@options.command()
def excite(
    machine: options.Machine,
    recorded: options.Recorded,
    derived: options.Derived,
    place: options.Place,
    out: Annotated[Path, Option(), Writes(".json", ".csv", ".mcap", ".npz")],
    own: Options,
    commands: Annotated[bool, Option("--commands")] = False,
    rate: Annotated[float | None, within(1, 100_000)] = None,
    periods: Annotated[int, counted(1, 10_000)] = 1,
    scale: LimitShare = 1.0,
    report: options.Report = None,
) -> None:
    """Find a motion that is worth measuring, within the limits of the robot."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.foundation.output import check_ending  # noqa: PLC0415
        from identifiability.workflows.excite import excite as run  # noqa: PLC0415
        from identifiability.workflows.excite import excite_commands  # noqa: PLC0415

        if commands:
            say("finding commands", 0.1)
            found = excite_commands(
                machine.load(recorded),
                duration=own.duration or 15.0,
                rate=rate or 50.0,
                limits=own.limits,
                scale=scale,
                seed=own.seed,
            )
            written = options.write_all((found.write, out))
            common.print_end([found.statement], written)
            return
        check_ending(out, ".json", ".csv", ".mcap")
        rate = rate or 500.0
        result = run(
            machine.load(recorded),
            preparation=derived.preparation(),
            progress=say,
            engine=place.stated(runner),
            **vars(own),
        )
        json = out.suffix.lower() == ".json"
        play = partial(result.write_motion, rate=rate, periods=periods)
        first = result.to_json if json else play
        written = options.Outputs(report).write(result, say, (first, out))
    rest = "" if json else f"{out.name} begins and ends at rest: {state_rest(result, rate)}."
    texts = [result.statement, *filter(None, [rest]), *result.hints]
    title = f"{result.robot.title}: the motion [SI units]"
    common.print_result(result, texts, written, title)


def state_rest(result: Excitation, rate: float) -> str:
    """Return the pose in which a motion begins and ends, as ``joint1 = 0.3, …``."""
    pose = result.play(rate).q[0]
    return ", ".join(f"{n} = {x:.4g}" for n, x in zip(result.limits.joints, pose, strict=True))
