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
    ExciteCriterion,
    Harmonics,
    LimitShare,
    Positive,
    Seed,
    counted,
    within,
)

if TYPE_CHECKING:
    from identifiability.workflows.excite import Excitation


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    harmonics: Annotated[Harmonics, "Harmonics of the finite Fourier series [Swevers 1997]."] = 5
    at_rest: Annotated[
        bool, "Begin and end without speed and acceleration, which takes two harmonics."
    ] = False
    duration: Annotated[
        Duration | None, "The period, by default 7.5 s; of commands 15 s in all."
    ] = None
    samples: Annotated[int, "Samples a period; all of them are checked."] = 750
    limits: Annotated[
        options.Limits,
        "TOML with JOINT = {q = [low, high], v = speed, a = acceleration, tau = torque, power = "
        "power} and [workspace.BODY] x, y, z = [low, high]; replaces limits of the robot file.",
    ] = None
    criterion: Annotated[
        ExciteCriterion | None,
        "Make small the condition number of the base columns, make large the information about "
        "--parameter, or separate two effects; by default what other options suggest.",
    ] = None
    parameters: Annotated[
        Sequence[str] | None,
        Option("--parameter"),
        "Base parameters that the information is about; by default all.",
    ] = None
    model: Annotated[
        options.Model,
        "Effects of the model; by default rigid bodies alone for the condition number, else also "
        "friction and actuator inertia. What a model file leaves out, holds or ties is free.",
    ] = None
    start_from: Annotated[
        Sequence[str] | None, "Log that was measured already: the motion is the best one next."
    ] = None
    separate: Annotated[
        Sequence[str] | None,
        "Effect to tell from another, everywhere (`stribeck_friction`) or at one place "
        "(`joint_stiffness@joint1`); two are given.",
    ] = None
    evaluations: Annotated[
        Count | None, "Motions that are looked at after the first random ones; by default 15 000."
    ] = None
    time_limit: Annotated[
        Positive | None, "Time after which the search stops [s]; then it is not reproducible."
    ] = None
    seed: Seed = 0


@options.command()
def excite(
    machine: options.Machine,
    recorded: options.Recorded,
    derived: options.Derived,
    place: options.Place,
    out: Annotated[
        Path,
        Option(),
        "File to write: .json (coefficients; `simulate ROBOT FILE.json` follows one period), or "
        "what a controller plays from rest to rest: .csv (t, JOINT.q, JOINT.dq, JOINT.ddq) or "
        ".mcap (a bag; extra ros). Commands: .csv (t, JOINT.cmd), .npz or .mcap.",
        Writes(".json", ".csv", ".mcap", ".npz"),
    ],
    own: Options,
    commands: Annotated[bool, Option("--commands"), "Find commands of position servos."] = False,
    rate: Annotated[
        float | None,
        within(1, 100_000),
        "Samples a second of .csv and .mcap [Hz]; by default 500, of commands 50.",
    ] = None,
    periods: Annotated[
        int,
        counted(1, 10_000),
        "Whole periods in them, between the lead-in from rest and the way back.",
    ] = 1,
    scale: Annotated[LimitShare, "Share of what the limits allow, of commands."] = 1.0,
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
