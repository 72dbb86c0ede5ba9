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
from identifiability.cli.options import command
from identifiability.foundation import options as kinds
from identifiability.foundation.errors import IdentifiabilityError, listing

if TYPE_CHECKING:
    from identifiability.logs import Log
    from identifiability.workflows.analyze import Analysis
    from identifiability.workflows.excite import Excitation
    from identifiability.workflows.prune import Ladder as Pruned

# To begin with.


@command()
def new(
    folder: Annotated[Path, options.Writes()],
    logs: Annotated[Sequence[str], Argument(), options.Records()] = (),
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
    folder: Annotated[Path, options.Writes()] = Path("reports"),
    seed: kinds.Seed = 0,
) -> None:
    """Run the main job on a simulated robot: the paper's 3-RPS with the paper's noise."""
    with common.sentences(), common.progress() as say:
        folder.mkdir(parents=True, exist_ok=True)
        outputs = options.Outputs(folder / "demo.html", folder / "demo.json")
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

    model: options.Model = None


@command()
def inspect(
    machine: options.Machine,
    outputs: options.Outputs,
    work: options.Work,
    own: InspectOptions,
    logs: Annotated[Sequence[str], Argument(), options.Records()] = (),
    template: Annotated[Path | None, options.Writes(".csv")] = None,
) -> None:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd."""
    with work.running() as (say, how, _):
        from identifiability.workflows.inspect import inspect as run  # noqa: PLC0415

        result = run(
            machine.load(),
            logs,
            **how,
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

    validate: options.MoreLogs = ()
    ladder: options.Ladder = None
    replicates: kinds.Replicates | None = None
    posterior: bool = False
    prior: options.Prior = None
    seed: kinds.Seed = 0
    quick: bool = False


@dataclass(frozen=True)
class OneMachine(options.Machine):
    """The robot; of many robots a folder each."""

    robot: Annotated[str, Argument(autocompletion=options.find_robots)] = ""


@command()
def analyze(
    machine: OneMachine,
    outputs: options.Outputs,
    work: options.Work,
    fitted: options.Fitted,
    own: AnalyzeOptions,
    logs: Annotated[Sequence[str], Argument(), options.Records()] = (),
    each: Annotated[Sequence[str], Option(metavar="FOLDER")] = (),
    out: Annotated[Path | None, options.Writes()] = None,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use."""
    with work.running() as (say, how, _):
        said: dict[str, Any] = {**how, **vars(fitted), **vars(own)}
        if each:
            one = (machine, outputs, list(logs), list(said.pop("validate")))
            if one != (OneMachine(), options.Outputs(), [], []) or out is None:
                raise kinds.OptionError(
                    "--each takes robots, logs and what is said of them from the folders and the "
                    "sidecars in them; give --out and how to fit beside it: identifiability "
                    "analyze --each FOLDER --each FOLDER --out RESULTS."
                )
            from identifiability.workflows.many import analyze_many  # noqa: PLC0415

            fleet = analyze_many(each, out, **said)
        elif not logs or out is not None:
            raise kinds.OptionError(
                "Give a robot and its logs, or folders of several robots with --each, and --out: "
                "identifiability analyze ROBOT LOG, or identifiability analyze --each FOLDER "
                "--out RESULTS."
            )
        else:
            from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

            result = run(machine.load(), logs, **said)
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

    validate: options.MoreLogs = ()
    ladder: options.Ladder = None
    forbid: Sequence[str] = ()
    force: Sequence[str] = ()
    replicates: kinds.Replicates | None = None
    prior: options.Prior = None
    seed: kinds.Seed = 0
    quick: bool = False


@command()
def prune(
    machine: options.Machine,
    logs: options.Logs,
    outputs: options.Outputs,
    work: options.Work,
    fitted: options.Fitted,
    own: PruneOptions,
    out: Annotated[Path | None, options.Writes(".toml")] = None,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone."""
    with work.running() as (say, how, _):
        from identifiability.workflows.prune import prune as run  # noqa: PLC0415

        result = run(
            machine.load(),
            logs,
            **how,
            **vars(fitted),
            **vars(own),
        )
        # The page knows of the file of the model.
        written = outputs.write(result, say, (result.write_model, out))
    print_pruning(result, written)


def print_pruning(result: Pruned, written: Sequence[Path]) -> None:
    """Print the ladder about the model to use, the statement, the paths of what was written."""
    title = f"{result.robot.title}: reduction path (▸ use this model)"
    texts = [result.statement, *filter(None, [result.mass_statement])]
    common.print_result(result, texts, written, title, result.selected + 4)


@dataclass(frozen=True)
class DiagnoseOptions:
    """What is asked for."""

    validate: options.MoreLogs = ()
    effects: options.Effects = None
    model: options.Model = None
    fixed: options.Fixed = False
    seed: kinds.Seed = 0
    quick: bool = False


@command()
def diagnose(
    machine: options.Machine,
    logs: options.Logs,
    outputs: options.Outputs,
    work: options.Work,
    own: DiagnoseOptions,
    out: Annotated[Path | None, options.Writes(".toml")] = None,
    motion: Annotated[Path | None, Option("--next"), options.Writes(".json")] = None,
    limits: options.Limits = None,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink."""
    with work.running() as (say, how, _):
        from identifiability.workflows.diagnose import diagnose as run  # noqa: PLC0415
        from identifiability.workflows.diagnose import find_next  # noqa: PLC0415

        result = run(
            machine.load(),
            logs,
            **how,
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
    replicates: kinds.Repeated | None = None
    names: kinds.Whole | None = None
    seed: kinds.Seed = 0
    quick: bool = False


@dataclass(frozen=True)
class FittedBefore:
    """How the model whose intervals are asked about is fitted."""

    table: ClassVar[str] = "fit"

    estimator: kinds.EstimatorKind = "auto"


@command()
def calibrate(
    machine: options.Machine,
    logs: options.Logs,
    outputs: options.Outputs,
    work: options.Work,
    fitted: FittedBefore,
    own: CalibrateOptions,
    ladder: options.Ladder = None,
    prior: options.Prior = None,
) -> None:
    """Say whether the intervals and verdicts of the model to use can be trusted here."""
    with work.running() as (say, how, engine):
        from identifiability.workflows.analyze import analyze as fit  # noqa: PLC0415
        from identifiability.workflows.calibrate.calibration import calibrate as run  # noqa: PLC0415

        robot = machine.load()
        robot.check_stands("calibration")  # before the logs are fitted for it
        analysis = fit(
            robot,
            logs,
            (),
            ladder,
            estimator=fitted.estimator,
            prior=prior,
            seed=own.seed,
            **{**how, "progress": lambda text, share: say(text, 0.2 * share)},
        )
        result = run(
            analysis,
            **vars(own),
            progress=lambda text, share: say(text, 0.2 + 0.8 * share),
            engine=engine,
        )
        written = outputs.write(result, say)
    common.print_result(result, [result.statement], written)


# What is done with a fit.


@command(motion_alone=True)
def predict(
    machine: options.Machine,
    result: Annotated[str, options.Records(results=True)],
    logs: Annotated[list[str], Argument(), options.Records()],
    outputs: options.Outputs,
    forward: Annotated[bool, Option("--forward")] = False,
    out: Annotated[Path | None, options.Table] = None,
) -> None:
    """Predict the torque of logs with a fitted model, or where they move its robot."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.predict import predict as run  # noqa: PLC0415

        say("predicting", 0.2)
        found = run(machine.load(), result, logs, forward=forward)
        written = outputs.write(found, say, (found.write, out))
    title = "Error of positions (rms)" if forward else "Predicted torque by joint"
    common.print_result(found, [found.statement, *found.hints], written, title)


#: Endings of what is exported.
EXPORTED = (".xml", ".urdf", ".json", ".py", ".csv", ".parquet", ".pq")


@command()
def export(
    machine: options.Machine,
    result: options.JsonResult,
    out: Annotated[Path, Option(), options.Writes(*EXPORTED)],
    draws: kinds.Count | None = None,
    form: Annotated[kinds.ExportFormat | None, Option("--format")] = None,
    validate: options.MoreLogs = (),
    force: Annotated[bool, Option("--force")] = False,
    prior: kinds.NotNegative | None = None,
    seed: kinds.Seed = 0,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file."""
    with common.sentences():
        from identifiability.regression.reduction import unused_ladder  # noqa: PLC0415
        from identifiability.workflows.export import draw_robots  # noqa: PLC0415
        from identifiability.workflows.export import export as run  # noqa: PLC0415

        robot = machine.load()
        if draws is not None:
            found = draw_robots(robot, result, draws, prior=prior, seed=seed)
            written = found.write(out)
            typer.echo(found.statement)
            typer.echo(f"{written[0]}" + (f" … {written[-1].name}" if len(written) > 1 else ""))
            return
        if prior is not None:
            raise kinds.OptionError(
                "--prior is of bodies that are drawn; say how many: --draws 100."
            )
        exported = run(robot, result, out, form, validate=validate, force=force)
    for text in filter(None, (exported.mass, exported.statement)):
        typer.echo(text)
    for text in unused_ladder(robot):
        typer.echo(text, err=True)
    for path in filter(None, (exported.robot, exported.sidecar)):
        typer.echo(f"{path}")


@dataclass(frozen=True)
class PayloadOptions:
    """What is asked for."""

    without: options.MoreLogs = ()
    body: str | None = None
    mass: kinds.Positive | None = None
    centre: options.Point | None = None
    inertia: options.Point | None = None


@command()
def payload(
    machine: options.Machine,
    result: options.JsonResult,
    logs: options.Logs,
    outputs: options.Outputs,
    own: PayloadOptions,
) -> None:
    """Weigh what hangs on a body: its mass, centre and inertia, with intervals."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.payload import payload as weigh  # noqa: PLC0415

        say("reading logs", 0.0)
        found = weigh(machine.load(), result, logs, **vars(own))
        written = outputs.write(found, say)
    common.print_end([*filter(None, [found.sidecar]), found.statement])
    common.print_result(found, found.hints, written)


@dataclass(frozen=True)
class CompareOptions:
    """What is asked for."""

    ladder: options.Ladder = None


@command()
def compare(
    machine: options.Machine,
    before: Annotated[str, options.Records(results=True)],
    after: Annotated[str, options.Records(results=True)],
    derived: options.Derived,
    outputs: options.Outputs,
    own: CompareOptions,
    more_before: Annotated[
        Sequence[str], Option("--before", metavar="LOG"), options.Records(results=True)
    ] = (),
    more_after: Annotated[
        Sequence[str], Option("--after", metavar="LOG"), options.Records(results=True)
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
                raise kinds.OptionError(
                    f"{results[0]} is a result, and stands beside others; give one result on each "
                    "side, or logs alone."
                )
            sides[k] = side[0] if results else side
        say("comparing", 0.3)
        found = find(machine.load(), *sides, preparation=derived.preparation(), **vars(own))
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
    seed: kinds.Seed = 0


@command()
def simulate(
    machine: options.Machine,
    motion: Annotated[str, options.Reads("motion", "CSV", always=False)],
    out: Annotated[Path, Option(), options.Table],
    own: SimulateOptions,
    samples: kinds.Period | None = None,
) -> None:
    """Make the log of a simulated robot along a prescribed motion."""
    with common.sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415
        from identifiability.simulation.forces import left_out  # noqa: PLC0415
        from identifiability.simulation.motion import find_motion  # noqa: PLC0415

        robot, rng = machine.load(), np.random.default_rng(own.seed)
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

    duration: kinds.Duration | None = None
    limits: options.Limits = None
    parameters: Annotated[Sequence[str] | None, Option("--parameter")] = None
    model: options.Model = None
    start_from: Annotated[Sequence[str] | None, options.Records()] = None
    separate: Sequence[str] | None = None
    seed: kinds.Seed = 0


@dataclass(frozen=True)
class Searched:
    """Of which motions the best is found."""

    table: ClassVar[str] = ""

    harmonics: kinds.Harmonics = 5
    at_rest: bool = False
    samples: int = 750
    evaluations: kinds.Count = 15_000


@dataclass(frozen=True)
class Played:
    """How a motion is written for a controller; commands also how far they go."""

    table: ClassVar[str] = ""

    periods: Annotated[int, kinds.counted(1, 10_000)] = 1
    scale: kinds.LimitShare = 1.0


@command()
def excite(
    machine: options.Machine,
    work: options.Work,
    out: Annotated[Path, Option(), options.Writes(".json", ".csv", ".mcap", ".npz")],
    own: ExciteOptions,
    searched: Searched,
    played: Played,
    commands: Annotated[bool, Option("--commands")] = False,
    rate: Annotated[float | None, kinds.within(1, 100_000)] = None,
    report: Annotated[Path | None, options.Writes(".html", ".htm")] = None,
) -> None:
    """Find a motion that is worth measuring, within the limits of the robot."""
    with work.running() as (say, how, _):
        from identifiability.foundation.output import check_ending  # noqa: PLC0415
        from identifiability.workflows.excite import excite as run  # noqa: PLC0415
        from identifiability.workflows.excite import excite_commands  # noqa: PLC0415

        if commands:
            say("finding commands", 0.1)
            found = excite_commands(
                machine.load(),
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
            machine.load(),
            **how,
            **vars(own),
            **vars(searched),
        )
        json = out.suffix.lower() == ".json"
        play = partial(result.write_motion, rate=rate, periods=played.periods)
        written = options.Outputs(report).write(
            result, say, (result.to_json if json else play, out)
        )
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
    place: options.Place,
    tables: Annotated[Sequence[str], Argument()] = (),
    quick: bool = False,
    seeds: kinds.Count | None = None,
    out: Annotated[Path, options.Writes()] = Path("reports"),
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
