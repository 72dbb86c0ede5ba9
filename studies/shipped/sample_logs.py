"""The logs in models/*/logs: simulated, ours, with an effect that no robot file states.

The README and the tutorials run on them. The simulated machine differs from its file as machines
do: rotors that a URDF cannot state, other friction, and one effect more (`Machine.hide`). Positions
are rounded to an encoder's steps, the torque has additive autocorrelated noise, and there are no
velocities and no accelerations. ``python studies/shipped/sample_logs.py`` writes them anew.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.simulation import Noise, Trajectory, shipped_trajectory
from identifiability.simulation.simulator import Campaign

MODELS = Path(__file__).resolve().parents[2] / "models"

#: A load of 2 kg at the flange of the arm, as a URDF states it. It is a cylinder of 60 mm across
#: and 70 mm long, 170 mm before the flange and 10 mm off the sixth axis.
_LOAD = """
  <joint name="grasp" type="fixed">
    <parent link="tool0"/><child link="load"/><origin xyz="0.01 0.0 0.17"/>
  </joint>
  <link name="load">
    <inertial>
      <origin xyz="0 0 0"/><mass value="2.0"/>
      <inertia ixx="0.00127" ixy="0" ixz="0" iyy="0.00127" iyz="0" izz="0.0009"/>
    </inertial>
  </link>
</robot>"""


@dataclass(frozen=True)
class Machine:
    """A shipped robot, and the differences of the logged machine.

    Attributes
    ----------
    robot : str
    runs : mapping of file name to trajectory
    hide : str
        The effect that the file does not state, as `Campaign.hidden` reads it.
    encoder : float [rad or m]
    parameters : mapping
        Values that differ from the nominal ones.
    loaded : mapping of file name to trajectory
        The same with a load at the flange.
    """

    robot: str
    runs: Mapping[str, str]
    hide: str
    encoder: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    loaded: Mapping[str, str] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Where the logs are kept."""
        return MODELS / self.robot / "logs"

    def logs(self) -> dict[str, Log]:
        """Return the logs by file name: one campaign, so that the effect is one in all of them."""
        robot, names = Robot.load(self.robot), [*self.runs, *self.loaded]
        motions = [
            shipped_trajectory(robot, name) for name in (*self.runs.values(), *self.loaded.values())
        ]
        bare = Campaign.of(robot, motions, self.parameters)
        torque = bare.torque.copy()
        if self.loaded:
            rows = bare.log >= len(self.runs)
            torque[rows] = _loaded_torque(robot, motions, self.parameters)[rows]
        noise = Noise(additive=0.02, correlation=0.5, encoder=self.encoder)
        logs = replace(bare, torque=torque).logs(bare.hidden([self.hide]), noise)
        return dict(zip(names, logs, strict=True))


def _loaded_torque(robot: Robot, motions: list[Trajectory], given: Mapping[str, float]) -> Array:
    """Return the torque (N, n) of the arm with the load at its flange."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / robot.path.name
        copy.write_text(robot.path.read_text().replace("</robot>", _LOAD.lstrip("\n")))
        copy.with_suffix(".toml").write_bytes(robot.path.with_suffix(".toml").read_bytes())
        return Campaign.of(Robot.load(copy), motions, given).torque


#: Rotors [kg·m²] of the arm, and friction that is not its file's.
_ARM = {
    **{f"joint_{k}.Ia": v for k, v in enumerate((3.1, 4.2, 1.6, 0.09, 0.07, 0.03), start=1)},
    **{"joint_1.Fv": 25.0, "joint_2.Fv": 24.0, "joint_3.Fv": 16.0, "joint_4.Fv": 1.9},
    **{"joint_1.Fc": 29.0, "joint_2.Fc": 41.0, "joint_3.Fc": 20.0, "joint_5.Fc": 3.2},
}
_RUNS = ("run1.csv", "run2.csv", "run3.csv")
MACHINES = (
    Machine(
        robot="six-dof-arm",
        runs=dict(zip(_RUNS, "abc", strict=True)),
        hide="stribeck_friction@joint_2=0.1",
        encoder=1e-5,
        parameters=_ARM,
        loaded={"loaded.csv": "c"},
    ),
    Machine(
        robot="3-rps",
        runs=dict(zip(_RUNS, ("571", "595", "601"), strict=True)),
        hide="passive_joint_friction=0.06",
        encoder=2e-6,
    ),
)


def main() -> None:
    """Write the logs anew."""
    argparse.ArgumentParser(description=__doc__.split("\n")[0]).parse_args()
    for machine in MACHINES:
        machine.folder.mkdir(exist_ok=True)
        for name, log in machine.logs().items():
            path = machine.folder / name
            log.to_frame().to_csv(path, index=False, float_format="%.6g")
            print(path.relative_to(MODELS.parent))


if __name__ == "__main__":
    main()
