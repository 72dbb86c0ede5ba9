"""What to do next after an analysis, as lines for the terminal."""

from __future__ import annotations

from identifiability.estimation.verdict import Class
from identifiability.workflows.analyze.result import Analysis
from identifiability.workflows.analyze.words import grade_of
from identifiability.workflows.commands import (
    held_back,
    ladder_option,
    name_export,
    name_logs,
    on_file,
    source_name,
)


def next_commands(analysis: Analysis) -> list[tuple[str, str]]:
    """Return at most three lines for the terminal, the most useful first."""
    robot, how = source_name(analysis.robot), analysis.settings.get("preparation")
    names = [s.name for s in analysis.samples]
    logs = name_logs(analysis.robot, names, how=how)
    held = held_back(analysis.validation)
    if analysis.leaning is not None:
        diagnose = f"identifiability diagnose {robot} {logs}{held}"
        return [
            (
                "Take gravity as the logs have it, and find what else is missing:",
                f"{diagnose} --report missing.html --out model.toml --json result.json",
            )
        ]
    if analysis.nothing:
        return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
    chosen, out = analysis.chosen, []
    suspect = analysis.missing.functions or chosen.contradicted
    if suspect or grade_of(chosen.error_ra_validation) != "very-good":
        page = "--report missing.html"
        text = "Find out what the model misses:"
        out.append((text, f"identifiability diagnose {robot} {logs}{held} {page}"))
    if chosen.count(Class.IDENTIFIABLE) < len(chosen.rung):
        text = "Drop what noise decides, and keep a model that a real robot can have:"
        more = f"{ladder_option(analysis.robot, analysis.source)} --report pruned.html"
        out.append((text, f"identifiability prune {robot} {logs}{held}{more} --json result.json"))
        text = "Or measure what these logs leave open:"
        begun = name_logs(analysis.robot, names, "--start-from", how)
        out.append((text, f"identifiability excite {robot} {begun} --out next.json"))
    again = f"identifiability analyze {robot} {logs}{held}"
    again += f"{ladder_option(analysis.robot, analysis.source)} --json"
    fit = analysis.fit
    text, name = name_export(analysis.robot, fit.names, fit.errors)
    use = f"identifiability export {robot} {{file}} --out {name}"
    line = on_file(analysis, "json", "result.json", again, use)
    out.append((text, line))
    return out[:3]
