"""Refuse a log by its first lines, before anything else of it, or any number, is looked at."""

from __future__ import annotations

from pathlib import Path

from identifiability.logs.command_names import choose_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.measured import call_currents, missing_torque
from identifiability.logs.naming import name_columns
from identifiability.logs.scan import BEGINNING, begin_csv
from identifiability.logs.tables import parsing

#: Bytes in which there is no quoted name in most logs.
QUOTED = 4096


def check_header(path: Path, known: Conventions) -> None:
    """Refuse a CSV whose columns are none of a robot's log; other files are left to their reader.

    Parameters
    ----------
    path : Path
    known : Conventions

    Raises
    ------
    LogError
        What `Log.read` would say of the columns.
    """
    if not path.is_file():  # a pipe would be waited for
        return
    with parsing(path):
        with path.open("rb") as file:
            start = file.read(BEGINNING)
        if b'"' in start[:QUOTED]:  # a name may go over several lines
            return
        table, rest = begin_csv(path, start)
        line = table.form.plain_text(rest).decode(errors="replace").partition("\n")[0]
        row = dict(zip(table.columns, table.form.split(line), strict=False))
    texts = {name: text for name, text in row.items() if not table.form.is_number(text)}
    commands, alone = choose_commands(table.columns, str(path), known)
    columns = [commands[c].name if c in commands else c for c in table.columns]
    made = missing_torque(columns, known) if known.motion_alone else []
    made = [f"{joint}.tau" for joint in known.joints] if alone else made
    found = [*columns, *made]
    called = call_currents(found, known)
    sources = dict(zip(called, found, strict=True))
    units = dict(zip(called, table.form.units, strict=False))
    currents = {name for name, column in sources.items() if name != column}
    name_columns(called, str(path), known, units, texts, currents=currents, made=made)
