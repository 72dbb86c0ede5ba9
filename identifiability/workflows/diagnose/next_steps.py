"""What to do next after a diagnosis, as lines for the terminal."""

from __future__ import annotations

from identifiability.workflows.commands import held_back, name_logs, source_name
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
    return [
        *(apart if any(e.alternatives for e in d.effects) else ()),
        (
            "Keep the diagnosed model:",
            f"identifiability diagnose {robot} {logs} --out model.toml --json result.json",
        ),
        (
            "Judge its parameters:",
            f"identifiability analyze {robot} {logs} --ladder model.toml --report report.html",
        ),
        (
            "Take it into a simulator:",
            f"identifiability export {robot} result.json --out fitted.xml",
        ),
    ]
