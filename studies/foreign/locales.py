"""Exports of controllers in three locales: their text, words, separators and units."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from foreign.case import Case, Writer, joints

#: For each language: time, position, velocity and torque, and the name of a column.
GERMAN = (
    "Zeit [ms]",
    "Achse {} Lage [°]",
    "Achse {} Geschwindigkeit [°/s]",
    "Achse {} Drehmoment [Nm]",
)
FRENCH = ("Temps [s]", "axe {} position [°]", "axe {} vitesse [tr/min]", "axe {} couple [daN.m]")
ENGLISH = ("Time (ms)", "{} Position (deg)", "{} Velocity (rpm)", "{} Torque (in-lb)")
SIZES = {
    GERMAN: (1e-3, np.pi / 180, np.pi / 180, 1.0),
    FRENCH: (1.0, np.pi / 180, np.pi / 30, 10.0),
    ENGLISH: (1e-3, np.pi / 180, np.pi / 30, 0.1129848290276167),
}


def export(
    names: tuple[str, ...],
    encoding: str,
    change: Callable[[str], str] = lambda s: s,
    *,
    velocity: bool = False,
    like: tuple[str, ...] = (),
    **form: str,
) -> Writer:
    """Return a writer of a log in the format of a controller.

    `like` names the columns of other units than the values have.
    """

    def write(frame: pd.DataFrame, folder, _: np.random.Generator):  # type: ignore[no-untyped-def]
        t, q, dq, tau = SIZES[names]
        words = like or names
        out = {words[0]: frame["t"] / t}
        for j in joints(frame):
            out[words[1].format(j)] = frame[f"{j}.q"] / q
            if velocity:
                out[words[2].format(j)] = np.gradient(frame[f"{j}.q"], frame["t"]) / dq
            out[words[3].format(j)] = frame[f"{j}.tau"] / tau
        whole = pd.DataFrame(out).to_csv(index=False, float_format="%.9g", **form)
        path = folder / "Trace.csv"
        path.write_bytes(change(whole).encode(encoding))
        return path

    return write


COMMAS = {"sep": ";", "decimal": ","}
TITLE = "Trace: Prüfstand 3\r\nDatum: 02.03.2026\r\n"


def _as(index: int, unit: str, names: tuple[str, ...] = GERMAN) -> tuple[str, ...]:
    return tuple(
        name.partition(" [")[0] + f" [{unit}]" if k == index else name
        for k, name in enumerate(names)
    )


def _case(name: str, write: Writer, *words: str, robot: str = "six-dof-arm") -> Case:
    return Case(name, "locales", write, words, robot)


LOCALES = [
    _case("German, Windows-1252", export(GERMAN, "cp1252", **COMMAS)),
    _case("German, Windows-1252, velocities", export(GERMAN, "cp1252", velocity=True, **COMMAS)),
    _case("German, UTF-8", export(GERMAN, "utf-8", **COMMAS)),
    _case("German, UTF-16", export(GERMAN, "utf-16", **COMMAS)),
    _case("German, UTF-16 without a mark", export(GERMAN, "utf-16-le", **COMMAS)),
    _case("German, a title", export(GERMAN, "cp1252", lambda s: TITLE + s, **COMMAS)),
    _case("German, Windows line ends", export(GERMAN, "cp1252", lambda s: s.replace("\n", "\r\n"),
                                              **COMMAS)),
    _case("German, Grad", export(GERMAN, "cp1252", like=_as(1, "Grad"), **COMMAS)),
    _case("German, two-link", export(GERMAN, "cp1252", **COMMAS), robot="two-link"),
    _case("German, increments", export(GERMAN, "cp1252", like=_as(1, "Ink"), **COMMAS),
          "states the unit 'Ink'"),
    _case("German, per cent", export(GERMAN, "cp1252", like=_as(3, "%"), **COMMAS),
          "in percent"),
    _case("French, Windows-1252", export(FRENCH, "cp1252", **COMMAS)),
    _case("French, ISO 8859-1, velocities", export(FRENCH, "latin-1", velocity=True, **COMMAS)),
    _case("French, tabs, UTF-16", export(FRENCH, "utf-16", sep="\t", decimal=",")),
    _case("French, an old Macintosh", export(FRENCH, "mac_roman", **COMMAS),
          "states the unit '¡'"),
    _case("French, DOS", export(FRENCH, "cp850", **COMMAS), "states the unit 'ø'"),
    _case("English, UTF-8 with a mark", export(ENGLISH, "utf-8-sig")),
    _case("English, velocities", export(ENGLISH, "utf-8", velocity=True)),
    _case("English, tabs, UTF-16", export(ENGLISH, "utf-16", sep="\t")),
    _case("English, counts", export(ENGLISH, "utf-8", like=_as(1, "counts", ENGLISH)),
          "states the unit 'counts'"),
]  # fmt: skip
