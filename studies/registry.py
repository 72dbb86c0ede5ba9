"""Every study: its name, its place, its question, and its options for a quick run.

`python studies NAME...` and `identifiability paper NAME...` run them by this list, `make check-all`
runs each in short, and docs/reference/studies.md is written from it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Study:
    """A study, which writes ``<name>.json`` and ``<name>.html``.

    Attributes
    ----------
    name : str
    asks : str
        One sentence.
    words : tuple of str
        What it is called beside its name.
    paper : bool
        Whether it is of the paper: run unless others are named, with required checks.
    quick : str
        Arguments of a run in short.
    data : str
        Folder of the data set without which it cannot run.
    file : str
        Its module, if that is not called as it is.
    """

    name: str
    asks: str
    words: tuple[str, ...] = ()
    paper: bool = False
    quick: str = "--quick"
    data: str = ""
    file: str = ""

    @property
    def module(self) -> str:
        """Name of its module."""
        return self.file or self.name


def _paper(name: str, asks: str, *words: str) -> Study:
    return Study(name, asks, words, paper=True)


STUDIES = (
    _paper("table_1_base_parameters", "Which base parameters does the robot have?", "1", "table1"),
    _paper("table_2_model_1", "What is identified of Model 1?", "2", "table2"),
    _paper("table_3_noise", "What does noise do to Models 1 to 4?", "3", "table3"),
    _paper("figure_4_noise_levels", "From which noise on is a model better?", "figure4", "fig4"),
    _paper("table_4_stribeck", "What does friction with a static level do?", "4", "table4"),
    _paper("table_5_passive_friction", "What does friction of passive joints do?", "5", "table5"),
    _paper("table_6_no_actuators", "What if no model has actuator inertia?", "6", "table6"),
    _paper("figure_5_split_forces", "Which part of a force is friction?", "figure5", "fig5"),
    _paper("figure_3_forces", "How do measured and modelled forces agree?", "figure3", "fig3"),
    _paper("table_7_stand_in", "What do the models err on our robot?", "7", "table7"),
    _paper("table_8_stand_in", "Which values does our robot have?", "8", "table8"),
    _paper("figure_6_held_out", "What do the models err on unseen motion?", "figure6", "fig6"),
    _paper("paper_slips", "Where does the paper contradict itself?", "slips"),
    Study("prune_without_a_simulator", "Does pruning find the right model from logs alone?"),
    Study("noisy_motion", "Do labels hold where the measured motion is noisy?"),
    Study("hidden_effect", "Is an effect that is hidden in simulated logs named at its place?"),
    Study(
        "hidden_physics",
        "Is it named where robots are simulated by another physics than is fitted?",
        file="hidden_physics_exam",
    ),
    Study("elastic_joints", "Are joints that bend named, and rigid arms left alone?"),
    Study("coverage", "Do intervals of 95 % hold the truth in 95 % of the cases?"),
    Study("coverage_posterior", "Do posteriors hold the truth as often where noise is slow?"),
    Study(
        "field_conditions",
        "What do robots and logs as people have them do to names, errors and labels?",
        quick="--commanded --draws 1",
    ),
    Study("kuka_lwr4", "What does a model of a KUKA LWR4+ err on other runs?", data="kuka_lwr4"),
    Study(
        "staubli_tx40",
        "Are the published values of a Stäubli TX40 found again?",
        data="staubli_tx40",
    ),
    Study("so101", "Does the exported robot move as a real hobby arm does?", data="so101"),
    Study("real_logs", "What do models err on logs of four real arms that chose nothing?"),
    Study("logs_compared", "Is what changed between logs named, and nothing where nothing did?"),
    Study("servo_robots", "Are motors, delays and motion of servos found from commands alone?"),
    Study("readings", "Are wrongly named columns corrected, and sound logs left as they are?"),
    Study("benchmark_peers", "How fast is it, compared with Pinocchio's loop, FIGAROH and cvxpy?"),
    Study("exam", "Which tool errs least on unseen motion?", file="public_exam"),
    Study("foreign_logs", "Are foreign and spoilt logs read right, or their faults named?"),
)
