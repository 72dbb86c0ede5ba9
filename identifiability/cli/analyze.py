"""``identifiability analyze``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identifiability.cli import common, options

if TYPE_CHECKING:
    from identifiability.workflows.analyze import Analysis


@options.command("workflows/analyze/workflow.py")
def analyze(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    **own: Any,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use.

    **You give** a robot file and one or more logs of its motion and torque. The motion should be
    as fast and as varied as the robot will ever move: what it never excites, no fit can tell.

    **You get** one verdict a parameter. *identifiable*: use the value. *weak*: only its sign is
    certain. *negligible*: leave it out. *not identifiable*: do not believe the number, whatever it
    is; the reason says whether noise, the motion or the structure is to blame. *not judged*: the
    logs are too short, or too slow for their cut-off, to say anything. And you get the
    model to use (▸): the smallest that predicts unseen motion as well as the best does.

    **Hold a log back** with --validate. Without one, stretches of the logs take turns.

    Begin with

        identifiability analyze 3-rps run.csv --report report.html

    and read the report from the top. Then

        identifiability analyze 3-rps run.csv --validate other.csv
        identifiability analyze arm.urdf a.csv b.csv --json arm.json
        identifiability analyze arm.urdf run.csv --cutoff 10
        identifiability analyze arm.urdf run.mcap:/joint_states

    Too few identifiable? Move faster and in other directions, log longer, or let *prune* look for
    the smaller model that these logs support. Error much above the noise? Something is missing in
    the model: *diagnose* names it.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            progress=say,
            engine=place.stated(runner),
            preparation=derived.preparation(),
            **own,
        )
        written = outputs.write(result, say)
    print_analysis(result, written)


def print_analysis(result: Analysis, written: Sequence[Path]) -> None:
    """Print the ladder, the errors, the statement, what to do next, the paths of what is there."""
    title = f"{result.robot.title}: models (▸ use this one)"
    first, *hints = common.apart(result.statement, result.hints)
    texts = filter(None, [first, result.mass_statement, *hints])
    common.print_result(result, texts, written, title)
