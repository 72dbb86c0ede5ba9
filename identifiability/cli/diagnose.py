"""``identifiability diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command(
    "workflows/diagnose/workflow.py",
    "workflows/diagnose/next_experiment.py:find_next limits",
    but=("forward", "fixed"),
)
def diagnose(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    out: Annotated[Path | None, Option(), Writes(".toml")] = None,
    motion: Annotated[Path | None, Option("--next"), Writes(".json")] = None,
    fixed: Annotated[bool, Option("--fixed")] = False,
    fixed_from: Annotated[Path | None, Option(), options.RESULT] = None,
    fixed_share: Annotated[float | None, Option("--fixed-share", "--prior")] = None,
    **own: Any,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink.

    **You give** a robot file and logs, as for *analyze*, and best one more with --validate: it
    takes no part in the choice and says whether the gap closes there too.

    **You get** the effects that are missing, each with its joint, how often simulated noise alone
    brings such a name (p, of all effects and joints together), and the error on unseen motion
    before and after. A name is given only where its odds are 19 to 1 at least and motion that took
    no part is likelier with it. "A or B" means that this motion cannot tell two effects apart;
    *excite --separate A --separate B* finds one that can. No name? Then the last sentences say how
    small an effect would have been seen.

    **Then** fit the model that has it: --out writes it for every other verb.

        identifiability diagnose arm.urdf a.csv b.csv --validate c.csv --out model.toml
        identifiability analyze arm.urdf a.csv b.csv --validate c.csv --ladder model.toml
        identifiability diagnose arm.urdf a.csv --effects stribeck_friction,time_delay
        identifiability diagnose 3-rps a.csv --model rigid_body,viscous_friction

    **"A or B"?** Log the motion of --next, and give all logs:

        identifiability diagnose arm.urdf a.csv b.csv --next motion.json
        identifiability diagnose arm.urdf a.csv b.csv new.csv

    Parameters
    ----------
    out
        Write the model with the named effects here, as a model file for every other verb.
    motion
        Write the motion to log next here: it tells an "A or B" apart or, where there is none, shows
        what these logs cannot tell from the model. --limits holds for it. The log of it is as long
        as is likely to decide, 16 min at most.
    fixed_from
        Keep the values of a result, with their covariance, instead of refitting them.
    fixed_share
        Keep the values of the robot file, which may be off by this share (a standard deviation).
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.workflows.diagnose import diagnose as run  # noqa: PLC0415
        from identifiability.workflows.diagnose import find_next  # noqa: PLC0415

        ways = {"--fixed": fixed or None, "--fixed-from": fixed_from, "--fixed-share": fixed_share}
        kept = {way: value for way, value in ways.items() if value is not None}
        if len(kept) > 1:
            raise OptionError(
                f"'fixed' can be said in one way at a time, not by {' and '.join(kept)}; give one "
                "of these."
            )
        for value in kept.values():
            own["fixed"] = value
        limits = own.pop("limits")
        result = run(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            engine=place.stated(runner),
            progress=say,
            **own,
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
        told = [result.statement]
        if motion is not None:
            found = find_next(result, limits=limits, seed=own["seed"], progress=say)
            told.append(found.statement)
            if not found.same:
                written += options.write_all((found.to_json, motion))
    common.print_result(result, told, written)
