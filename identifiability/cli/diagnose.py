"""``identifiability diagnose``."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options


@options.command
def diagnose(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    validate: options.Validate = None,
    effects: str | None = None,
    model: options.Model = None,
    out: Path | None = None,
    fixed: Annotated[bool, Option("--fixed")] = False,
    seed: options.Seed = 0,
    quick: bool = False,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink.

    ```
    identifiability diagnose 3-rps run1.csv run2.csv --validate run3.csv --report gap.html
    identifiability diagnose arm.urdf run.parquet --model rigid_body --out model.toml
    ```

    Parameters
    ----------
    effects
        Families that may be named, such as stribeck_friction,time_delay.
    out
        Write the model with the named effects here, as a model file for every other verb.
    fixed
        Keep the robot file's values instead of refitting.
    quick
        Half the draws: coarser p-values.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.diagnose import diagnose as run  # noqa: PLC0415

        held = validate or ()
        outputs.check(out, inputs=[*machine.files, *logs, *held])
        result = run(
            machine.load(recorded),
            logs,
            held,
            effects=options.split_names(effects),
            model=options.split_model(model),
            fixed=fixed,
            seed=seed,
            quick=quick,
            preparation=derived.preparation(),
            engine=runner if any(astuple(place)) else None,
            progress=say,
        )
        written = outputs.write(result, say)
        if out is not None:
            written.append(result.write_model(out))
    if result.effects:
        headings = ("effect", "where", "p", "unseen error before", "after")
        rows = [
            (
                " or ".join([e.name, *e.alternatives]),
                ", ".join(e.joints),
                f"{e.p_value:.2g}",
                common.percent(e.before),
                common.percent(e.after),
            )
            for e in result.effects
        ]
        title = f"{result.robot.title}: effects that were missing"
        common.print_table(title, headings, rows, left=("effect", "where"))
    table = [
        (
            e["joint"],
            *(common.percent(e[k], 1) for k in ("before", "after")),
            f"{e['rms_after']:.3g}",
            common.percent(e["raw_after"], 1),
        )
        for e in result.error_frame().to_dict("records")
    ]
    title = "Errors by joint on unseen motion, each over its own scale"
    common.print_table(
        title, ("joint", "before", "after", "rms after", "raw after"), table, left=("joint",)
    )
    common.print_end([result.statement], written)
