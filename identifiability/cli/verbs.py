"""The verbs: load, validate, call the function of the same name, print where results are.

A function here that `command` decorates is a verb; what its help says stands in ``help.toml``.
Heavy imports stand inside the functions, so that ``--help`` is quick.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer
from typer import Argument, Exit, Option

from identifiability.cli import common, options
from identifiability.cli.options import (
    Derived,
    Fitted,
    JsonResult,
    Ladder,
    Limits,
    Logs,
    Machine,
    Model,
    MoreLogs,
    Outputs,
    Parsed,
    Place,
    Prior,
    Reads,
    Recorded,
    Records,
    Writes,
    command,
)
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.options import (
    Count,
    Duration,
    EstimatorKind,
    ExportFormat,
    Harmonics,
    LimitShare,
    NotNegative,
    OptionError,
    Period,
    Positive,
    Repeated,
    Replicates,
    Seed,
    Whole,
    counted,
    within,
)

if TYPE_CHECKING:
    from identifiability.logs import Log
    from identifiability.workflows.analyze import Analysis
    from identifiability.workflows.excite import Excitation
    from identifiability.workflows.prune import Ladder as Pruned

# To begin with.


@command()
def new(
    folder: Annotated[Path, Writes()],
    logs: Annotated[Sequence[str], Argument(), Records()] = (),
    robot: str = "six-dof-arm",
) -> None:
    """Make a folder to begin a study in: robot, sidecar, logs, script and Makefile."""
    with common.sentences():
        from identifiability.workflows.study import new_study  # noqa: PLC0415

        made = new_study(folder, robot, logs)
    common.print_end([*made.notes, made.statement], made.written)


@command()
def demo(
    quick: bool = False,
    folder: Annotated[Path, Writes()] = Path("reports"),
    seed: Seed = 0,
) -> None:
    """Run the main job on a simulated robot: the paper's 3-RPS with the paper's noise."""
    with common.sentences(), common.progress() as say:
        folder.mkdir(parents=True, exist_ok=True)
        outputs = Outputs(folder / "demo.html", folder / "demo.json")
        common.check_outputs(outputs.report, outputs.json)
        result, logs = run_demo(quick, seed, say, folder)
        read = [log.write(log.path) for log in logs]  # what the page's lines are about
        written = [*read, *outputs.write(result, say)]
    print_analysis(result, written)
    page = (folder / "demo.html").resolve().as_uri()
    print(f"Open the page: python -m webbrowser {page}")


def run_demo(
    quick: bool,
    seed: int = 0,
    say: Callable[[str, float], None] = lambda _text, _share: None,
    folder: Path = Path("reports"),
) -> tuple[Analysis, list[Log]]:
    """Analyse Models 1 to 4 of the 3-RPS robot on trajectory 601, validated on 595.

    Returns the logs, too, which have the paths of files in a folder that they may be written to.
    """
    import numpy as np  # noqa: PLC0415

    from identifiability.robot import Robot  # noqa: PLC0415
    from identifiability.simulation import PAPER_NOISE, simulate  # noqa: PLC0415
    from identifiability.simulation.motion import find_motion  # noqa: PLC0415
    from identifiability.workflows.analyze import analyze  # noqa: PLC0415

    robot, logs = Robot.load("3-rps"), []
    for name, rng in zip(("601", "595"), np.random.default_rng(seed).spawn(2), strict=True):
        say(f"simulating trajectory {name}", 0.0)
        motion = find_motion(robot, name, 100 if quick else None, rng)
        log = simulate(robot, motion, noise=PAPER_NOISE, rng=rng)
        logs.append(replace(log, name=f"{name}.csv", path=str(folder / f"{name}.csv")))
    return analyze(robot, logs[:1], logs[1:], seed=seed, progress=say), logs


@dataclass(frozen=True)
class InspectOptions:
    """What is asked for."""

    model: Model = None


@command()
def inspect(
    machine: Machine,
    recorded: Recorded,
    outputs: Outputs,
    derived: Derived,
    place: Place,
    own: InspectOptions,
    logs: Annotated[Sequence[str], Argument(), Records()] = (),
    template: Annotated[Path | None, Writes(".csv")] = None,
) -> None:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.inspect import inspect as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            progress=say,
            engine=place.stated(runner),
            **vars(own),
        )
        written = outputs.write(result, say, (result.write_template, template))
    hints: Sequence[str] = result.hints
    if not result.records:
        hints = [f"{n.text} {n.line}".strip().replace("\n", " ") for n in result.needs]
    common.print_result(result, [result.statement, *hints], written)


# Fits.


@dataclass(frozen=True)
class AnalyzeOptions:
    """What is asked for."""

    validate: MoreLogs = ()
    ladder: Ladder = None
    replicates: Replicates | None = None
    posterior: bool = False
    prior: Prior = None
    seed: Seed = 0
    quick: bool = False


@dataclass(frozen=True)
class OneMachine(Machine):
    """The robot; of many robots a folder each."""

    robot: options.RobotName = ""


@command()
def analyze(
    machine: OneMachine,
    recorded: Recorded,
    outputs: Outputs,
    derived: Derived,
    place: Place,
    fitted: Fitted,
    own: AnalyzeOptions,
    logs: Annotated[Sequence[str], Argument(), Records()] = (),
    each: Annotated[Sequence[str], Option(metavar="FOLDER")] = (),
    out: Annotated[Path | None, Writes()] = None,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        said: dict[str, Any] = {"engine": place.stated(runner), "progress": say, **vars(fitted)}
        said |= {**vars(own), "preparation": derived.preparation()}
        if each:
            one = (machine, recorded, outputs, list(logs), list(said.pop("validate")))
            if one != (OneMachine(), Recorded(), Outputs(), [], []) or out is None:
                raise OptionError(
                    "--each takes robots, logs and what is said of them from the folders and the "
                    "sidecars in them; give --out and how to fit beside it: identifiability "
                    "analyze --each FOLDER --each FOLDER --out RESULTS."
                )
            from identifiability.workflows.many import analyze_many  # noqa: PLC0415

            fleet = analyze_many(each, out, **said)
        elif not logs or out is not None:
            raise OptionError(
                "Give a robot and its logs, or folders of several robots with --each, and --out: "
                "identifiability analyze ROBOT LOG, or identifiability analyze --each FOLDER "
                "--out RESULTS."
            )
        else:
            from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

            result = run(machine.load(recorded), logs, **said)
            written = outputs.write(result, say)
    if not each:
        print_analysis(result, written)
        return
    common.print_result(fleet, [fleet.statement], fleet.files, f"{fleet.heading[0]}: analyze")
    if fleet.failed:
        raise Exit(1)


def print_analysis(result: Analysis, written: Sequence[Path]) -> None:
    """Print the ladder, the errors, the statement, what to do next, the paths of what is there."""
    title = f"{result.robot.title}: models (▸ use this one)"
    first, *hints = common.apart(result.statement, result.hints)
    texts = filter(None, [first, result.mass_statement, *hints])
    common.print_result(result, texts, written, title)


@dataclass(frozen=True)
class PruneOptions:
    """What is asked for."""

    validate: MoreLogs = ()
    ladder: Ladder = None
    forbid: Sequence[str] = ()
    force: Sequence[str] = ()
    replicates: Replicates | None = None
    prior: Prior = None
    seed: Seed = 0
    quick: bool = False


@command()
def prune(
    machine: Machine,
    recorded: Recorded,
    logs: Logs,
    outputs: Outputs,
    derived: Derived,
    place: Place,
    fitted: Fitted,
    own: PruneOptions,
    out: Annotated[Path | None, Writes(".toml")] = None,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.prune import prune as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            progress=say,
            engine=runner,
            preparation=derived.preparation(),
            **vars(fitted),
            **vars(own),
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
    print_pruning(result, written)


def print_pruning(result: Pruned, written: Sequence[Path]) -> None:
    """Print the ladder about the model to use, the statement, the paths of what was written."""
    title = f"{result.robot.title}: reduction path (▸ use this model)"
    stability = [] if result.nothing else [result.stability.statement]
    texts = [result.statement, *filter(None, [result.mass_statement]), *stability]
    common.print_result(result, texts, written, title, result.selected + 4)


@dataclass(frozen=True)
class DiagnoseOptions:
    """What is asked for."""

    validate: MoreLogs = ()
    effects: options.Effects = None
    model: Model = None
    fixed: options.Fixed = False
    seed: Seed = 0
    quick: bool = False


@command()
def diagnose(
    machine: Machine,
    recorded: Recorded,
    logs: Logs,
    outputs: Outputs,
    derived: Derived,
    place: Place,
    own: DiagnoseOptions,
    out: Annotated[Path | None, Writes(".toml")] = None,
    motion: Annotated[Path | None, Option("--next"), Writes(".json")] = None,
    limits: Limits = None,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.diagnose import diagnose as run  # noqa: PLC0415
        from identifiability.workflows.diagnose import find_next  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            engine=place.stated(runner),
            progress=say,
            **vars(own),
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
        told = [result.statement]
        if motion is not None:
            found = find_next(result, limits=limits, seed=own.seed, progress=say)
            told.append(found.statement)
            if not found.same:
                written += common.write_all((found.to_json, motion))
    common.print_result(result, told, written)


@dataclass(frozen=True)
class CalibrateOptions:
    """What is asked for."""

    model: str | None = None
    replicates: Repeated | None = None
    names: Whole | None = None
    seed: Seed = 0
    quick: bool = False


@dataclass(frozen=True)
class FittedBefore:
    """How the model whose intervals are asked about is fitted."""

    table: ClassVar[str] = "fit"

    estimator: EstimatorKind = "auto"


@command()
def calibrate(
    machine: Machine,
    recorded: Recorded,
    logs: Logs,
    outputs: Outputs,
    derived: Derived,
    place: Place,
    fitted: FittedBefore,
    own: CalibrateOptions,
    ladder: Ladder = None,
    prior: Prior = None,
) -> None:
    """Say whether the intervals and verdicts of the model to use can be trusted here."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.analyze import analyze as fit  # noqa: PLC0415
        from identifiability.workflows.calibrate.calibration import calibrate as run  # noqa: PLC0415

        robot = machine.load(recorded)
        robot.check_stands("calibration")  # before the logs are fitted for it
        analysis = fit(
            robot,
            logs,
            (),
            ladder,
            estimator=fitted.estimator,
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


# What is done with a fit.


@command(motion_alone=True)
def predict(
    machine: Machine,
    recorded: Recorded,
    result: Annotated[str, Records(results=True)],
    outputs: Outputs,
    logs: Annotated[Sequence[str], Argument(), Records()] = (),
    forward: Annotated[bool, Option("--forward")] = False,
    out: Annotated[Path | None, options.Table] = None,
) -> None:
    """Predict the torque of logs with a fitted model, or positions from commands."""
    with common.sentences(), common.progress() as say:
        is_result = Path(result).suffix.lower() in (".json", ".xml", ".urdf")
        if not forward:
            if not is_result or not logs:
                raise OptionError(
                    "Give a robot, the JSON of a result, and logs: identifiability predict ROBOT "
                    "RESULT.json LOG."
                )
            from identifiability.workflows.predict import read_fit  # noqa: PLC0415

            say("reading the result", 0.0)
            fit = read_fit(result, machine.load(recorded))
            say("predicting torque", 0.2)
            found: Any = fit.predict(logs)
        else:
            from identifiability.workflows.rollout import rollout  # noqa: PLC0415

            say("rolling out commands", 0.0)
            moved = [*logs] if is_result else [result, *logs]
            found = rollout(machine.load(recorded), moved, result if is_result else None)
        written = outputs.write(found, say, (found.write, out))
    title = "Error of positions (rms)" if forward else "Predicted torque by joint"
    common.print_result(found, [found.statement, *found.hints], written, title)


#: Endings of what is exported.
EXPORTED = (".xml", ".urdf", ".json", ".py", ".csv", ".parquet", ".pq")


@command()
def export(
    machine: Machine,
    recorded: Recorded,
    result: JsonResult,
    out: Annotated[Path, Option(), Writes(*EXPORTED)],
    draws: Count | None = None,
    form: Annotated[ExportFormat | None, Option("--format")] = None,
    force: Annotated[bool, Option("--force")] = False,
    prior: NotNegative | None = None,
    seed: Seed = 0,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file."""
    with common.sentences():
        from identifiability.regression.reduction import unused_ladder  # noqa: PLC0415
        from identifiability.workflows.export import draw_robots  # noqa: PLC0415
        from identifiability.workflows.export import export as run  # noqa: PLC0415

        robot = machine.load(recorded)
        if draws is not None:
            found = draw_robots(robot, result, draws, prior=prior, seed=seed)
            written = found.write(out)
            typer.echo(found.statement)
            typer.echo(f"{written[0]}" + (f" … {written[-1].name}" if len(written) > 1 else ""))
            return
        if prior is not None:
            raise OptionError("--prior is of bodies that are drawn; say how many: --draws 100.")
        exported = run(robot, result, out, form, force=force)
    for text in unused_ladder(robot):
        typer.echo(text, err=True)
    lines = (exported.mass, exported.statement, exported.robot, exported.sidecar)
    for line in filter(None, lines):
        typer.echo(f"{line}")


@dataclass(frozen=True)
class PayloadOptions:
    """What is asked for."""

    without: MoreLogs = ()
    body: str | None = None
    mass: Positive | None = None
    centre: options.Point | None = None
    inertia: options.Point | None = None


@command()
def payload(
    machine: Machine,
    recorded: Recorded,
    result: JsonResult,
    logs: Logs,
    outputs: Outputs,
    own: PayloadOptions,
) -> None:
    """Weigh what hangs on a body: its mass, centre and inertia, with intervals."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.payload import payload as weigh  # noqa: PLC0415

        say("reading logs", 0.0)
        found = weigh(machine.load(recorded), result, logs, **vars(own))
        written = outputs.write(found, say)
    common.print_end([*filter(None, [found.sidecar]), found.statement])
    common.print_result(found, found.hints, written)


@dataclass(frozen=True)
class CompareOptions:
    """What is asked for."""

    ladder: Ladder = None


@command()
def compare(
    machine: Machine,
    recorded: Recorded,
    before: Annotated[str, Records(results=True)],
    after: Annotated[str, Records(results=True)],
    derived: Derived,
    outputs: Outputs,
    own: CompareOptions,
    more_before: Annotated[
        Sequence[str], Option("--before", metavar="LOG"), Records(results=True)
    ] = (),
    more_after: Annotated[
        Sequence[str], Option("--after", metavar="LOG"), Records(results=True)
    ] = (),
) -> None:
    """Say what changed between two logs, or two results, of one robot."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.compare import compare as find  # noqa: PLC0415

        say("reading logs", 0.0)
        sides: list[Any] = [[before, *more_before], [after, *more_after]]
        for k, side in enumerate(sides):
            results = [path for path in side if Path(path).suffix.lower() == ".json"]
            if results and len(side) > 1:
                raise OptionError(
                    f"{results[0]} is a result, and stands beside others; give one result on each "
                    "side, or logs alone."
                )
            sides[k] = side[0] if results else side
        say("comparing", 0.3)
        found = find(machine.load(recorded), *sides, preparation=derived.preparation(), **vars(own))
        written = outputs.write(found, say)
    common.print_end([found.statement])
    common.print_result(found, found.hints, written)


# Motions, and logs of robots that are known.


@dataclass(frozen=True)
class SimulateOptions:
    """What is asked for."""

    noise: Annotated[str | None, Option(metavar="LEVELS")] = None
    hide: Sequence[str] = ()
    derivatives: bool = True
    seed: Seed = 0


@command()
def simulate(
    machine: Machine,
    recorded: Recorded,
    motion: Annotated[str, Reads("motion", "CSV", always=False)],
    out: Annotated[Path, Option(), options.Table],
    own: SimulateOptions,
    samples: Period | None = None,
) -> None:
    """Make the log of a simulated robot along a prescribed motion."""
    with common.sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415
        from identifiability.simulation.forces import left_out  # noqa: PLC0415
        from identifiability.simulation.motion import find_motion  # noqa: PLC0415

        robot, rng = machine.load(recorded), np.random.default_rng(own.seed)
        move = find_motion(robot, motion, samples, rng)
        log = run(robot, move, laws=effect_laws(), rng=rng, **vars(own))
        log.write(out)
        missing = left_out(robot)
    if missing:
        typer.echo(
            f"The robot's sidecar states {listing(missing, 6)}, which are not simulated: give such "
            "effects by --hide."
        )
    typer.echo(f"{len(log)} samples of {robot.name} along {log.name}: {out}")


@dataclass(frozen=True)
class ExciteOptions:
    """What is asked for."""

    duration: Duration | None = None
    limits: Limits = None
    parameters: Annotated[Sequence[str] | None, Option("--parameter")] = None
    model: Model = None
    start_from: Annotated[Sequence[str] | None, Records()] = None
    separate: Sequence[str] | None = None
    seed: Seed = 0


@dataclass(frozen=True)
class Searched:
    """Of which motions the best is found."""

    table: ClassVar[str] = ""

    harmonics: Harmonics = 5
    at_rest: bool = False
    samples: int = 750
    evaluations: Count = 15_000


@dataclass(frozen=True)
class Played:
    """How a motion is written for a controller; commands also how far they go."""

    table: ClassVar[str] = ""

    periods: Annotated[int, counted(1, 10_000)] = 1
    scale: LimitShare = 1.0


@command()
def excite(
    machine: Machine,
    recorded: Recorded,
    derived: Derived,
    place: Place,
    out: Annotated[Path, Option(), Writes(".json", ".csv", ".mcap", ".npz")],
    own: ExciteOptions,
    searched: Searched,
    played: Played,
    commands: Annotated[bool, Option("--commands")] = False,
    rate: Annotated[float | None, within(1, 100_000)] = None,
    report: Annotated[Path | None, Writes(".html", ".htm")] = None,
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
                scale=played.scale,
                seed=own.seed,
            )
            written = common.write_all((found.write, out))
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
            **vars(searched),
        )
        json = out.suffix.lower() == ".json"
        play = partial(result.write_motion, rate=rate, periods=played.periods)
        written = Outputs(report).write(result, say, (result.to_json if json else play, out))
    rest = "" if json else f"{out.name} begins and ends at rest: {state_rest(result, rate)}."
    texts = [result.statement, *filter(None, [rest]), *result.hints]
    title = f"{result.robot.title}: the motion [SI units]"
    common.print_result(result, texts, written, title)


def state_rest(result: Excitation, rate: float) -> str:
    """Return the pose in which a motion begins and ends, as ``joint1 = 0.3, …``."""
    pose = result.play(rate).q[0]
    return ", ".join(f"{n} = {x:.4g}" for n, x in zip(result.limits.joints, pose, strict=True))


# The paper.

#: The studies, beside the package in a checkout, and where to get one.
STUDIES = Path(__file__).resolve().parents[2] / "studies"
SOURCE = "https://github.com/robot-identifiability/identifiability"


@command()
def paper(
    place: Place,
    tables: Annotated[Sequence[str], Argument()] = (),
    quick: bool = False,
    seeds: Count | None = None,
    out: Annotated[Path, Writes()] = Path("reports"),
) -> None:
    """Compute every table and figure of the paper, ours beside the printed numbers."""
    with common.sentences():
        if not (STUDIES / "registry.py").is_file():
            raise IdentifiabilityError(
                "The studies are part of the source checkout, in its folder 'studies', not of the "
                f"installed package: 'git clone {SOURCE}' and run 'identifiability paper' there, "
                "once it is installed from it ('pip install -e .')."
            )
    words = [*tables, "--out", str(out), *(["--quick"] if quick else [])]
    words += [] if seeds is None else ["--seeds", str(seeds)]
    runpy.run_path(str(STUDIES), {"words": words, "place": place}, "__main__")
