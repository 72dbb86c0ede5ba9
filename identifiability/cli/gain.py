"""``identifiability gain``."""

from __future__ import annotations

from typing import Annotated

from typer import Option

from identifiability.cli import common, options


@options.command()
def gain(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    derived: options.Derived,
    outputs: options.Outputs,
    loaded: Annotated[list[str], Option()],
    mass: Annotated[float, Option(min=0)],
    centre: Annotated[str, Option(metavar="X,Y,Z")] = "0,0,0",
    inertia: Annotated[str, Option(metavar="X,Y,Z")] = "0,0,0",
    body: str | None = None,
    model: options.Model = None,
) -> None:
    """Identify what one unit of each torque column is, from logs with and without a known load.

    Currents tell torque up to a factor of each joint, and so do sensors that nobody calibrated.
    Fix a load that you have weighed to the last body, and move as before: one log without it, one
    with it. What is printed goes into the robot's sidecar.

    **You get** N·m per unit of each column, with its interval. *weak* and *not identifiable* gains
    saw too little of the load: hold it where it weighs on that joint.

        identifiability gain arm.urdf empty.csv --loaded loaded.csv --mass 2.5 --centre 0,0,0.08

    Parameters
    ----------
    logs
        Logs without the load, with `<joint>.current` or `<joint>.tau` in any unit.
    loaded
        Log with the load; may be given several times.
    mass
        Of the load [kg].
    centre
        Its centre of mass in the frame of the joint of its body [m].
    inertia
        Its moments of inertia about its centre [kg m²].
    body
        Which it is fixed to; default: the last one.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.gains import identify_gains  # noqa: PLC0415

        say("reading logs", 0.0)
        result = identify_gains(
            machine.load(recorded),
            logs,
            loaded,
            mass=mass,
            centre=_numbers(centre, "--centre"),
            inertia=_numbers(inertia, "--inertia"),
            body=body,
            model=options.split_model(model),
            preparation=derived.preparation(),
        )
        written = outputs.write(result, say)
    texts = [*filter(None, [result.sidecar]), result.statement, *result.hints]
    common.print_result(result, texts, written, [machine.robot, *logs, *loaded])


def _numbers(text: str, option: str) -> list[float]:
    """Return the numbers in ``x,y,z``."""
    from identifiability.foundation.options import OptionError  # noqa: PLC0415

    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise OptionError(
            f"{option} {text} is no point; give three numbers, such as 0,0,0.08."
        ) from None
