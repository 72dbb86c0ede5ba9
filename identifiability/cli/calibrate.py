"""``identifiability calibrate``."""

from __future__ import annotations

from dataclasses import dataclass

from identifiability.cli import common, options
from identifiability.foundation.options import Repeated, Seed, Whole


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    model: str | None = None
    replicates: Repeated | None = None
    names: Whole | None = None
    seed: Seed = 0
    quick: options.Quick = False


@options.command()
def calibrate(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
    ladder: options.Ladder = None,
    estimator: options.Estimator = "auto",
    prior: options.Prior = None,
) -> None:
    """Say whether the intervals and verdicts of the model to use can be trusted here."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.analyze import analyze  # noqa: PLC0415
        from identifiability.workflows.calibrate.calibration import calibrate as run  # noqa: PLC0415

        robot = machine.load(recorded)
        robot.check_stands("calibration")  # before the logs are fitted for it
        analysis = analyze(
            robot,
            logs,
            (),
            ladder,
            estimator=estimator,
            prior=prior,
            preparation=derived.preparation(),
            seed=own.seed,
            progress=lambda text, share: say(text, 0.2 * share),
            engine=place.stated(runner),
        )
        result = run(
            analysis,
            **vars(own),
            progress=lambda text, share: say(text, 0.2 + 0.8 * share),
            engine=runner,
        )
        written = outputs.write(result, say)
    common.print_result(result, [result.statement], written)
