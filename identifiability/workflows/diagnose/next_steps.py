"""What to do next after a diagnosis, as lines for the terminal."""

from __future__ import annotations

from identifiability.workflows.commands import (
    held_back,
    name_export,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.diagnose.result import Diagnosis


def next_commands(d: Diagnosis) -> list[tuple[str, str]]:
    """Return lines for the terminal, the most useful first."""
    robot = source_name(d.robot)
    logs = name_logs(d.robot, [s.name for s in d.samples], how=d.preparation)
    logs += held_back(d.validation, d.samples)
    ask = f"identifiability diagnose {robot} {logs} --next motion.json"
    if not d.effects:
        what = "See which parameters these logs determine:"
        hidden = any(a.structural for a in d.aliases)
        shows = [("Find the motion that shows what these logs cannot tell from the model:", ask)]
        analyze = f"identifiability analyze {robot} {logs} --report report.html"
        return [(what, analyze), *(shows if hidden else ())]
    apart = [("Find the motion that tells one name from the other:", ask)]
    again = f"identifiability diagnose {robot} {logs}"
    judge = f"identifiability analyze {robot} {logs} --ladder {{file}} --report report.html"
    text, name = name_export(d.robot, d.fit.names)
    use = f"identifiability export {robot} {{file}} --out {name}"
    return [
        *(apart if any(e.alternatives for e in d.effects) else ()),
        (
            "Judge the parameters of the diagnosed model:",
            on_file(d, "model", "model.toml", f"{again} --out", judge),
        ),
        (
            text,
            on_file(d, "json", "result.json", f"{again} --json", use),
        ),
    ]
