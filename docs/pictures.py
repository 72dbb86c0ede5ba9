"""The pictures of README and docs; ``MUJOCO_GL=egl python docs/pictures.py`` makes them.

The arm is drawn by MuJoCo (without ``MUJOCO_GL`` on a screen), the first screens of the pages of
``docs/gallery.py`` by Chromium. ``images/pictures.json`` keeps the answers that each picture shows;
with it, tests find pictures that are out of date.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import runpy
import shutil
import subprocess
import tempfile
from hashlib import sha256
from pathlib import Path

import numpy as np

from identifiability.foundation.result import Result
from identifiability.workflows.analyze import Analysis

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
#: What each picture says, as it was made.
RECORD = IMAGES / "pictures.json"

#: Visual geometry is kept, and links that do not move stay bodies of their own.
_VISIBLE = '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco>'

#: From none to all of a body's parameters identifiable.
_NONE, _ALL = np.array([0.80, 0.36, 0.24]), np.array([0.16, 0.52, 0.40])
_STILL = np.array([0.62, 0.62, 0.62])


def draw_arm(result: Analysis, path: Path, size: int = 640) -> None:
    """Draw the arm, each body coloured by the share of its parameters that is identifiable."""
    import mujoco  # noqa: PLC0415
    from PIL import Image  # noqa: PLC0415

    opening = f'<robot name="{result.robot.name}">'
    text = result.robot.path.read_text(encoding="utf-8")
    text = text.replace('<robot name="six-dof-arm">', f"{opening}{_VISIBLE}", 1)
    model = mujoco.MjModel.from_xml_string(text)
    table = result.to_frame()
    for geom in range(model.ngeom):
        body = model.body(model.geom_bodyid[geom]).name
        own = table[table["name"].str.startswith(f"{body}.")]
        colour = _STILL
        if len(own):
            share = float((own["verdict"] == "identifiable").mean())
            colour = _NONE + share * (_ALL - _NONE)
        model.geom_rgba[geom] = [*colour, 1.0]
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.5
    model.vis.global_.offwidth = model.vis.global_.offheight = 2 * size
    data = mujoco.MjData(model)
    data.qpos[:] = [0.5, 0.35, 0.25, 0.4, -0.7, 0.0]
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = (0.28, 0.12, 0.62), 1.9
    camera.azimuth, camera.elevation = 130, -14
    with mujoco.Renderer(model, 2 * size, 2 * size) as renderer:
        renderer.update_scene(data, camera)
        pixels = renderer.render().copy()
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera)
        pixels[renderer.render()[..., 0] < 0] = 255  # no sky behind the robot
    rows, columns = (np.flatnonzero((pixels < 255).any((axis, 2))) for axis in (1, 0))
    seen = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    image = Image.fromarray(seen).resize(
        (seen.shape[1] // 2, seen.shape[0] // 2), Image.Resampling.LANCZOS
    )
    image.quantize(64).save(path, optimize=True)


def photograph(page: Path, path: Path, width: int = 1280, height: int = 900) -> None:
    """Save the first screen of a page as a small PNG."""
    from PIL import Image  # noqa: PLC0415

    browser = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))))
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--disable-gpu"]
        size = f"--window-size={width},{height}"
        command = [browser, *options, size, f"--screenshot={shot}", page.as_uri()]
        subprocess.run(command, check=True, capture_output=True)
        image = Image.open(shot).convert("RGB")
        smaller = image.resize((width * 3 // 4, height * 3 // 4), Image.Resampling.LANCZOS)
        smaller.quantize(128, kmeans=1).save(path, optimize=True)


def describe_picture(result: Result, picture: Path) -> dict[str, object]:
    """Return what a picture of a result says: its answers, and the hash of its file."""
    return {"sha256": sha256(picture.read_bytes()).hexdigest(), "answers": shown_answers(result)}


def shown_answers(result: Result) -> dict[str, str]:
    """Return the short answer to each question of a page, and what its next lines are for."""
    answers = {answer.question: answer.short for answer in result.answers()}
    return answers | {"next lines": " ".join(purpose for purpose, _ in result.next())}


def main() -> None:
    """Make the pictures."""
    argparse.ArgumentParser(description=__doc__.split("\n")[0]).parse_args()
    IMAGES.mkdir(parents=True, exist_ok=True)
    pages = runpy.run_path(str(DOCS / "gallery.py"))["PAGES"]
    record = {}
    for name, make in pages.items():
        with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
            result = make(Path())
            page = result.write_report(Path(place) / f"{name}.html")
            pictures = [IMAGES / f"page-{name}.png"]
            photograph(page, pictures[0])
            if name == "arm":
                pictures.append(IMAGES / "arm.png")
                draw_arm(result, pictures[1])
            record |= {picture.name: describe_picture(result, picture) for picture in pictures}
    text = json.dumps(record, indent=1, ensure_ascii=False, sort_keys=True)
    RECORD.write_text(text + "\n", encoding="utf-8")
    for path in sorted(IMAGES.iterdir()):
        print(f"{path.relative_to(IMAGES.parents[1])}: {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main()
