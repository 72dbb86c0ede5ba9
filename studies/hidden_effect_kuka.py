"""What does rigid-body dynamics miss on a real arm? KUKA LWR4+, each run named, another held out.

    python studies/hidden_effect_kuka.py --data FOLDER --out reports/hidden_effect_kuka.json

Coulomb friction, offsets and viscous friction are expected; naming Stribeck or quadratic friction
here would be the classic mistake: they fit the run that they are named from and spoil the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import kuka_lwr4
from real_data.study import read_arguments

from identifiability.effects import FAMILIES
from identifiability.foundation.output import write_json
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose import Diagnosis, Problem, Setting, diagnose
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.motion import prepare_rows

#: Runs to name from and runs that are held out.
SPLITS = (((1,), (3,)), ((3,), (1,)), ((1, 3), (2,)))

#: Families that are added to all joints at once, to see what each does to the held-out error.
JOINTLY = (
    ("coulomb_friction",),
    ("coulomb_friction", "torque_offset"),
    ("coulomb_friction", "torque_offset", "viscous_friction"),
)
BESIDE = ("quadratic_friction", "joint_stiffness", "load_dependent_friction", "actuator_inertia")


def run(data: Any, train: Sequence[int], test: Sequence[int], **options: Any) -> Diagnosis:
    """Return the diagnosis of the rigid-body model from some runs; options are `diagnose`'s."""
    robot = kuka_lwr4.load_robot(data)
    logs, held = ([kuka_lwr4.load_log(data, robot, k) for k in runs] for runs in (train, test))
    return diagnose(robot, logs, held, model=["rigid_body"], **options)


def errors_together(data: Any, train: int, test: int) -> dict[str, float]:
    """Return the held-out error with whole families added to every joint, without any test."""
    robot = kuka_lwr4.load_robot(data)
    rows = [(prepare_rows(robot, kuka_lwr4.load_log(data, robot, k), None),) for k in (train, test)]
    p = Problem(Setting(Structure.of(robot, Model.of("rigid_body")), *rows))
    sets = [(), *JOINTLY, *((*JOINTLY[-1], name) for name in BESIDE)]
    out = {}
    for names in sets:
        chosen = [k for k, c in enumerate(p.candidates) if c.family.name in names]
        left = p.residual(p.unseen.rows, chosen, p.settled(chosen))
        label = " + ".join(FAMILIES[n].title for n in names) or "rigid body"
        out[label] = float(Gap(p.unseen.rows, left[:, :, None]).relative_error()[0])
    return out


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, print what is named and write it."""
    arguments = read_arguments("kuka_lwr4", str(__doc__).partition("\n")[0], argv)
    if arguments.out.stem == "kuka_lwr4":
        arguments.out = arguments.out.with_name("hidden_effect_kuka.json")
    result: dict[str, Any] = {"together": errors_together(arguments.data, 1, 3), "runs": []}
    for label, error in result["together"].items():
        print(f"{100 * error:6.2f} %  {label}")
    for train, test in SPLITS[: 1 if arguments.quick else None]:
        d = run(arguments.data, train, test)
        print(f"\nnamed from run {train}, held out run {test}:\n{d.statement}")
        result["runs"].append({"train": train, "test": test, **d.to_dict()})
        if (train, test) == SPLITS[0]:
            arguments.out.parent.mkdir(parents=True, exist_ok=True)
            print(d.write_report(arguments.out.with_suffix(".html")))
    print(write_json(arguments.out, result))


if __name__ == "__main__":
    main()
