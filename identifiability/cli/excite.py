"""``identifiability excite``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

if TYPE_CHECKING:
    from identifiability.workflows.excite import Excitation


@options.command(
    "workflows/excite/workflow.py",
    "workflows/excite/commands.py:excite_commands scale",
    but=("iterations",),
    parameters="--parameter",
)
def excite(
    machine: options.Machine,
    recorded: options.Recorded,
    derived: options.Derived,
    place: options.Place,
    out: Annotated[Path, Option(), Writes(".json", ".csv", ".mcap", ".npz")],
    commands: Annotated[bool, Option("--commands")] = False,
    rate: Annotated[float | None, Option(min=1, max=100_000)] = None,
    periods: Annotated[int, Option(min=1, max=10_000)] = 1,
    report: options.Report = None,
    **own: Any,
) -> None:
    """Find a motion that is worth measuring, within the limits of the robot.

    **You give** a robot file, and best its limits (*--limits*, or the sidecar's): what nobody
    states is assumed, and said. **You get** a periodic motion, a finite Fourier series, that keeps
    limits of position, speed, acceleration, torque and power; where the file has geometry no two
    bodies touch along it; a closed chain stays away from singular configurations. The table says
    what each joint does and may do. Look at the motion before the robot goes through it.

        identifiability excite 3-rps --out motion.json --report motion.html
        identifiability excite arm.urdf --limits limits.toml --out motion.csv --rate 250 --periods 3

        identifiability excite quadruped --commands --out commands.csv

    The first file is for *simulate*, the second is what a controller plays, from rest to rest;
    .mcap is the same as a bag. **Then** record it, and *analyze* the log.

    A robot without torque sensors gets the **commands** of its position servos instead
    (multi-sine, chirp, steps; rest to rest), such that in a simulation of its file position, speed
    and servo torque stay within limits. Begin with less, *--scale 0.3*: the file may be wrong.

    By default all parameters shall be told well by one log (condition number). Ask for more with

        identifiability excite arm.urdf --start-from run.csv --parameter link3.mx --out next.json
        identifiability excite arm.urdf --separate torque_offset --separate payload --out m.json

    what to measure next for one parameter, and what tells two effects apart that *diagnose* could
    not (also *diagnose --next*).

    Parameters
    ----------
    out
        File to write: .json (coefficients; 'simulate ROBOT FILE.json' follows one period), or what
        a controller plays from rest to rest: .csv (t, JOINT.q, JOINT.dq, JOINT.ddq) or .mcap (a bag
        with a JointTrajectory; extra ros). Commands: .csv (t, JOINT.cmd), .npz or .mcap (a
        Float64MultiArray each).
    commands
        Find commands of position servos.
    rate
        Samples a second of .csv and .mcap [Hz]; default: 500, of commands 50.
    periods
        Whole periods in them, between the lead-in from rest and the way back.
    report
        Write an HTML report here.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.foundation.output import check_ending  # noqa: PLC0415
        from identifiability.workflows.excite import excite as run  # noqa: PLC0415
        from identifiability.workflows.excite import excite_commands  # noqa: PLC0415

        scale = own.pop("scale")
        if commands:
            say("finding commands", 0.1)
            found = excite_commands(
                machine.load(recorded),
                duration=own["duration"] or 15.0,
                rate=rate or 50.0,
                limits=own["limits"],
                scale=scale,
                seed=own["seed"],
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
            **own,
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
