"""README and docs are true: their blocks run in order, commands and links lead somewhere."""

import contextlib
import io
import json
import re
import runpy
import shlex
import sys
import tempfile
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

import identifiability
from identifiability.foundation.engines import Serial

from .conftest import COMMANDS, invoke_well, quickly

ROOT = Path(__file__).resolve().parents[1]
#: Where the package is, here or installed.
SITE = Path(identifiability.__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]

#: Pages that run from top to bottom in an empty folder, as they are printed.
RUN = ["README.md", *(f"docs/tutorials/{p.name}" for p in sorted(ROOT.glob("docs/tutorials/*.md")))]
RUN += ["docs/how-to/python.md", "docs/how-to/many.md"]

#: Verbs that a quick run of the README leaves out: what follows does not need them, or, as Python,
#: asks the same; of the same verb twice it does the first.
SLOW = {"prune", "calibrate", "excite", "diagnose", "demo"}
AGAIN = ("--ladder",)
#: Lines of the README that no test runs.
CHECKOUT = ("make demo", "make test")
INSTALL = (
    "git clone https://github.com/robot-identifiability/identifiability",
    "pip install ./identifiability",
)
#: What the others are called with in its Python.
FEW = {
    "analyze": {"replicates": 20, "engine": Serial()},
    "prune": {"replicates": 20},
    "diagnose": {"effects": ["stribeck_friction", "position_ripple"], "engine": Serial()},
}


def blocks(page):
    """Line, language and text of the fenced blocks of a page."""
    text = page.read_text()
    for found in re.finditer(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        yield text.count("\n", 0, found.start()) + 2, found[1], found[2]


def lines(text):
    """The commands of a block."""
    return [line[2:] for line in text.splitlines() if line.startswith("$ ")]


def type_in(line, *, quick):
    """Run a command as a shell would, in this process."""
    program, *words = shlex.split(line, comments=True)
    if program == "cd":
        contextlib.chdir(words[0]).__enter__()  # the folder of the test comes back by itself
    elif program == "identifiability":
        if quick and (words[0] in SLOW or any(w in AGAIN for w in words)):
            return
        words = [*quickly(*words)] if quick else words
        if quick and words[0] == "analyze" and "--report" in words:  # its Python writes that page
            at = words.index("--report")
            del words[at : at + 2]
        invoke_well(*words)
    else:
        assert line in (*CHECKOUT, *INSTALL), f"nothing runs '{line}' here"


def run(page, folder, *, quick):
    """Run the blocks of a page in order, in a folder.

    Returns what each block of Python printed beside what the page says that it prints, in a block
    of text that follows; empty where it says nothing.
    """
    known = {"__name__": "page"}
    pairs = []
    with contextlib.chdir(folder), pytest.MonkeyPatch.context() as patch:
        for verb, less in FEW.items() if quick else ():
            patch.setattr(identifiability, verb, partial(getattr(identifiability, verb), **less))
        for line, language, text in blocks(page):
            if language == "console":
                for command in lines(text):
                    type_in(command, quick=quick)
            elif language == "python":
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    # Padded, so that a traceback names the line of the page.
                    exec(compile("\n" * (line - 1) + text, str(page), "exec"), known)
                pairs.append((out.getvalue(), ""))
            elif language == "text":
                pairs[-1] = (pairs[-1][0], text)
    return pairs


#: A number in what is printed; a sign that is typeset is part of it.
NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def agree(said, printed):
    """Whether two texts have the same words, and numbers within 5 %: processors round otherwise."""
    ours, theirs = (
        [float(n.replace("−", "-")) for n in NUMBER.findall(t)] for t in (said, printed)
    )
    words, others = (" ".join(NUMBER.sub("#", t).split()) for t in (said, printed))
    same = len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=0.05, atol=1e-3)
    return words == others and same


def test_the_readme_runs_from_top_to_bottom(tmp_path):
    """With few random draws, and without the verbs that take long and the pictures."""
    said = " ".join(said for said, _ in run(ROOT / "README.md", tmp_path, quick=True))
    assert "Error on unseen motion" in said  # the decision
    assert "Stribeck friction in joint_2" in said  # what the logs have and the robot file has not
    for name in ("report.html", "inspection.html", "better.html"):
        page = (tmp_path / "study" / name).read_text()
        assert page.rstrip().endswith("</html>")
    for name in ("torque.csv", "fitted.xml", "again.csv", "result.json"):
        assert (tmp_path / "study" / name).is_file()


@pytest.mark.everything
@pytest.mark.pictures
@pytest.mark.parametrize("page", RUN)
def test_a_page_runs_as_it_is_printed(page, tmp_path):
    for said, printed in run(ROOT / page, tmp_path, quick=False):
        assert not printed or agree(said, printed), f"{said}\n{printed}"


def test_only_rounding_may_be_otherwise():
    assert agree("error 1.21 %", "error 1.22 %")
    assert not agree("error 1.21 %", "error 1.5 %")
    assert not agree("joint_1 errs by 1.2 %", "joint_2 errs by 1.2 %")
    assert not agree("it is possible", "it is impossible")


def test_the_readme_is_short_and_begins_with_a_picture_and_two_commands():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 90
    first, second, study, *_ = (block for _, _, block in blocks(ROOT / "README.md"))
    assert lines(first) == [*CHECKOUT]
    before = text[: text.index(first)].partition("\n")[2]
    assert len(re.findall(r"\.(?=\s)", before)) == 3  # sentences
    assert lines(second) == [*INSTALL]
    assert text.count("](docs/images/") == 1
    assert sum(line.startswith("identifiability ") for line in lines(study)) == 5


#: What each picture shows, as docs/pictures.py wrote it beside them.
PICTURED = json.loads((ROOT / "docs/images/pictures.json").read_text())


def said_in(text):
    """Counts such as '29 of 52', and percentages, that a text states."""
    return {*re.findall(r"\d+ of \d+", text)}, {*re.findall(r"\d[\d.]*(?= %)", text)}


def differs(readme, shown):
    """Figures of the README's study that pictures do not show; they may be rounded."""
    counts, shares = said_in(readme)
    shown_counts, shown_shares = said_in(shown)
    wrong = counts - shown_counts
    for share in shares:
        places = len(share.partition(".")[2])
        wrong |= {share} - {f"{float(x):.{places}f}" for x in shown_shares}
    return wrong


def test_figures_of_the_readme_are_those_of_its_pictures():
    assert differs("29 of 52, error 2.7 % and 1.2 %", "32 of 52, 2.74 % and 1.3 %") == {
        "29 of 52",
        "1.2",
    }
    text = (ROOT / "README.md").read_text()
    study = text.partition("## From URDF and CSV")[2].partition("\n## ")[0]
    shown = " ".join(s for n in ("arm", "missing") for s in answers_in(f"page-{n}.png").values())
    assert len(said_in(study)[1]) >= 3
    assert differs(study, shown) == set()


def answers_in(picture):
    """Question and short answer that a picture shows."""
    return PICTURED[picture]["answers"]


def test_each_picture_of_a_page_is_the_file_that_was_described():
    folder = ROOT / "docs/images"
    assert {p.name for p in folder.glob("page-*.png")} <= {*PICTURED}
    for name, told in PICTURED.items():
        assert sha256((folder / name).read_bytes()).hexdigest() == told["sha256"], name


GALLERY = runpy.run_path(str(ROOT / "docs/gallery.py"))["PAGES"]
PICTURES = runpy.run_path(str(ROOT / "docs/pictures.py"))
#: Pages whose figures the README states.
STATED = ("arm", "missing")


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=() if p in STATED else pytest.mark.everything) for p in GALLERY]
)
def test_a_picture_shows_the_answers_of_today(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    today = PICTURES["shown_answers"](GALLERY[page](Path()))
    shown = answers_in(f"page-{page}.png")
    stale = "run MUJOCO_GL=egl python docs/pictures.py"
    assert today.keys() == shown.keys(), stale
    for question, short in today.items():
        assert agree(short, shown[question]), f"{short}\n{shown[question]}\n{stale}"


def shown_commands():
    """Every ``identifiability …`` of the pages and of the commands' own help."""
    told = [line for page in PAGES for _, kind, text in blocks(page) for line in lines(text)]
    readme = PAGES[0].read_text()
    told += re.findall(r"\| `(identifiability [^`]+)` \|", readme)
    told += [line.strip() for c in COMMANDS.values() for line in (c.help or "").splitlines()]
    return {line for line in told if line.startswith("identifiability ")}


def test_commands_that_are_shown_can_be_typed(monkeypatch):
    """Arguments and options are parsed as on the command line, and nothing is run or looked for."""
    monkeypatch.setattr("identifiability.cli.options._look", lambda *_: None)
    shown = shown_commands()
    assert len(shown) > 40
    for line in sorted(shown):
        _, name, *words = shlex.split(line.split(" | ")[0], comments=True)
        assert name in COMMANDS or name.startswith("--"), f"there is no command '{name}'"
        if name in COMMANDS:
            try:
                COMMANDS[name].make_context(name, words)
            except Exception as error:
                raise AssertionError(f"{line}: {error}") from error


def test_every_command_has_a_place_in_the_documentation():
    told = " ".join(page.read_text() for page in PAGES)
    for name in COMMANDS:
        assert f"`{name}" in told or f"identifiability {name} " in told, name


READ = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "llms.txt"]


@pytest.mark.parametrize("page", READ, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_and_paths_lead_somewhere(page):
    text = page.read_text()
    for path in re.findall(r"`((?:identifiability|models|studies)/[\w./-]+\.\w+)`", text):
        assert (ROOT / path).exists() or (SITE / path).exists()
    for path in re.findall(r"\]\(([^)#]+)(?:#[\w-]*)?\)", text):
        assert path.startswith("http") or (page.parent / path).exists()


def write_anew(page):
    """Write what a page's Python prints into its blocks of text."""
    with tempfile.TemporaryDirectory() as folder:
        said = (said for said, printed in run(page, Path(folder), quick=False) if printed)
    text = page.read_text()
    new = re.sub(
        r"^```text\n.*?^```",
        lambda _: f"```text\n{next(said)}```",
        text,
        flags=re.MULTILINE | re.DOTALL,
    )
    page.write_text(new)


if __name__ == "__main__":  # python tests/test_readme.py docs/tutorials/decision.md
    for name in sys.argv[1:]:
        write_anew(ROOT / name)
