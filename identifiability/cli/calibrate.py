"""``identifiability calibrate``."""

from __future__ import annotations

from typing import Annotated, Any

from typer import Option

from identifiability.cli import common, options


@options.command(
    "workflows/calibrate/calibration.py",
    "workflows/analyze/workflow.py:analyze ladder estimator prior",
)
def calibrate(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    sbc: Annotated[bool, Option(help="Also check the posterior by simulation (some seconds).")] = (
        True  # of how many experiments is the library's
    ),
    **own: Any,
) -> None:
    """Say whether the intervals and verdicts of the model to use can be trusted here.

    **You give** a robot file and logs, as for *analyze*. **You get** yes, no or for which
    parameters not, and the cause. Ask it before you hand intervals on; it takes minutes, --quick
    less.

    The experiment is repeated with robots around the likeliest one, with what the model leaves out,
    noise like the residual and errors of the motion like the log's: how often do 95 % intervals
    hold the truth, how often is a parameter called identifiable wrong by more than half? If the
    answer is no, each cause is switched off to find the one to blame. Shares come with their
    Monte-Carlo error. And are planted values ranked uniformly among the draws of their posterior?
    How often does diagnose name an effect when nothing is missing, and how small an effect would
    it see?

        identifiability calibrate 3-rps run.csv --report calibration.html
        identifiability calibrate arm.urdf a.csv b.csv --ladder pruned.toml --quick
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.analyze import analyze  # noqa: PLC0415
        from identifiability.workflows.calibrate.calibration import calibrate as run  # noqa: PLC0415

        robot = machine.load(recorded)
        robot.check_stands("calibration")  # before the logs are fitted for it
        analysis = analyze(
            robot,
            logs,
            (),
            own.pop("ladder"),
            estimator=own.pop("estimator"),
            prior=own.pop("prior"),
            preparation=derived.preparation(),
            seed=own["seed"],
            progress=lambda text, share: say(text, 0.2 * share),
            engine=place.stated(runner),
        )
        result = run(
            analysis,
            sbc=None if sbc else 0,
            **own,
            progress=lambda text, share: say(text, 0.2 + 0.8 * share),
            engine=runner,
        )
        written = outputs.write(result, say)
    common.print_result(result, [result.statement, *result.notes], written)
