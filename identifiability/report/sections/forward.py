"""The section on forward simulation: does the corrected model move like the robot?"""

from __future__ import annotations

from identifiability.report.blocks import Block, Picture, Prose, Section
from identifiability.report.figures.forward import draw_forward
from identifiability.report.numbers import format_number
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.diagnose.forward_gap import ForwardGap


def section_forward(gap: ForwardGap, joints: tuple[str, ...]) -> Section:
    """Return the section on simulated motion before and after the named effects."""
    lead = (
        f"Stretches of {format_number(gap.horizon, 2)} s of unseen motion, started from measured "
        "states and driven by the measured torque: the simulated positions against the measured."
    )
    if not gap.measured:
        return Section("motion", "In simulated motion", lead, (Prose((f"Not done: {gap.note}",)),))
    before, after = gap.shares()
    caption = (
        f"Mean over joints, as a share of the distance moved; median and middle half of "
        f"{len(gap.before)} stretches. Either model has the values of the nearest real robot."
    )
    blocks: list[Block] = [
        Picture(draw_forward(gap.t, before, after), caption, "Simulated position error over time")
    ]
    columns = (
        Column("joint"), Column("before", "number", "Of the distance moved, at the end."),
        Column("after", "number"),
    )  # fmt: skip
    ends = [gap.joint_shares()[k] for k in (0, 1)]
    rows = tuple(
        (
            Cell(joint),
            *(Cell(f"{format_number(100 * float(e[k]), 3)} %", float(e[k])) for e in ends),
        )
        for k, joint in enumerate(joints)
    )
    blocks.append(Table("Position error at the end of a stretch", columns, rows))
    return Section("motion", "In simulated motion", lead, tuple(blocks))
