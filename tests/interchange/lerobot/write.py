"""Write the datasets beside this file with LeRobot itself: v2.1 by its 0.3.3, v3.0 by its 0.4.4.

``python write.py FOLDER JOINTS FPS LOG.csv ...`` in an environment of its own, which takes
gigabytes; an episode is a log, here the first 75 rows of two of the hobby arm's.
"""

import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import CODEBASE_VERSION, LeRobotDataset

folder, joints, fps, *logs = sys.argv[1:]
names = joints.split(",")
vector = {"dtype": "float32", "shape": (len(names),), "names": [f"{n}.pos" for n in names]}
dataset = LeRobotDataset.create(
    "ours/hobby-arm",
    int(fps),
    root=Path(folder),
    robot_type="hobby-arm",
    features={"observation.state": dict(vector), "action": dict(vector)},
    use_videos=False,
)
for path in logs:
    for row in np.genfromtxt(path, delimiter=",", names=True, deletechars=""):
        frame = {
            feature: np.array([row[f"{n}.{kind}"] for n in names], np.float32)
            for feature, kind in (("observation.state", "q"), ("action", "cmd"))
        }
        if CODEBASE_VERSION == "v2.1":
            dataset.add_frame(frame, task="move")
        else:
            dataset.add_frame({**frame, "task": "move"})
    dataset.save_episode()
if hasattr(dataset, "finalize"):
    dataset.finalize()
