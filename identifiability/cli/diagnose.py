"""``identifiability diagnose``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import Seed


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    validate: Sequence[str] = ()
    effects: options.Effects | None = None
    model: options.Model = None
    seed: Seed = 0
    quick: options.Quick = False


@options.command()
def diagnose(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
    out: Annotated[Path | None, Writes(".toml")] = None,
    motion: Annotated[Path | None, Option("--next"), Writes(".json")] = None,
    limits: options.Limits = None,
    fixed: Annotated[bool, Option("--fixed")] = False,
    fixed_from: Annotated[Path | None, options.RESULT] = None,
    fixed_share: Annotated[float | None, Option("--fixed-share", "--prior")] = None,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink."""
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
        result = run(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            engine=place.stated(runner),
            progress=say,
            fixed=next(iter(kept.values()), False),
            **vars(own),
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
        told = [result.statement]
        if motion is not None:
            found = find_next(result, limits=limits, seed=own.seed, progress=say)
            told.append(found.statement)
            if not found.same:
                written += options.write_all((found.to_json, motion))
    common.print_result(result, told, written)
