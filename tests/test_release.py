"""What an index and a citation show agrees with the package."""

import re
import sys
import tomllib
from pathlib import Path

from typer.main import get_command

import identifiability
from identifiability.cli import app

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(identifiability.__file__).parent
TOML = tomllib.loads((ROOT / "pyproject.toml").read_text())
HOME = TOML["project"]["urls"]["Homepage"]


def shown_readme():
    """Return the README as an index shows it, without the files beside it."""
    hook = TOML["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    text = "".join((ROOT / piece["path"]).read_text() for piece in hook["fragments"])
    for step in hook["substitutions"]:
        text = re.sub(step["pattern"], step["replacement"], text)
    return text


def test_the_readme_in_an_index_has_no_relative_link_and_each_leads_to_a_file():
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", shown_readme())
    assert len(links) > 10
    raw = HOME.replace("//github.com/", "//raw.githubusercontent.com/") + "/main/"
    for picture, link in links:
        base = raw if picture else f"{HOME}/blob/main/"
        assert link.startswith(base)
        assert (ROOT / link.removeprefix(base)).exists()


def test_the_changelog_is_one_page_on_this_version_and_names_every_command():
    text = (ROOT / "CHANGELOG.md").read_text()
    assert len(text.splitlines()) <= 60
    assert re.findall(r"^## (\S+)", text, re.MULTILINE) == [identifiability.__version__]
    told = text.partition("**Commands**")[2].partition("**Answers**")[0].partition("\n")[2]
    named = set(re.findall(r"`([a-z]+)`", told))
    assert named == set(get_command(app).commands)


def test_make_exam_gives_its_script_an_option_that_it_knows(process):
    script, option = re.search(r"(studies\S*) .*,(--\w+)", (ROOT / "Makefile").read_text()).groups()
    words = [sys.executable, ROOT / script, "--help"]
    assert option in process(words, check=True).stdout


def test_sentences_on_extras_name_an_extra_of_a_checkout():
    named = set()
    for path in PACKAGE.rglob("*.py"):
        named |= set(re.findall(r"install '\.\[(\w+)\]'", path.read_text()))
    assert named
    assert set(TOML["project"]["optional-dependencies"]) >= named


def test_every_source_that_code_or_pages_cite_stands_in_the_list():
    key = re.compile(r"\[((?:de |van )?[A-ZÀ-Þ][\w'’-]*(?: & [A-Z][\w'’-]*)? \d{4})")
    listed = set(key.findall((ROOT / "docs/reference" / "sources.md").read_text()))
    cited = {}
    for folder in (PACKAGE, ROOT / "models", ROOT / "docs"):
        for path in folder.rglob("*.*"):
            if path.suffix in {".py", ".md", ".toml", ".j2"}:
                cited |= dict.fromkeys(key.findall(path.read_text()), str(path))
    assert len(cited) > 50
    assert not {k: path for k, path in cited.items() if k not in listed}


def test_the_recipe_for_conda_is_of_this_version_and_has_the_same_dependencies():
    recipe = (ROOT / "recipe/recipe.yaml").read_text()
    assert f'version: "{identifiability.__version__}"' in recipe
    called = {"pin": "pinocchio-python", "mujoco": "mujoco-python", "matplotlib": "matplotlib-base"}
    run = recipe.partition("  run:")[2].partition("\ntests:")[0]
    stated = dict(re.findall(r"- ([\w-]+) (\S+)", run))
    wanted = dict(
        re.fullmatch(r"([\w-]+)(.*)", d).groups() for d in TOML["project"]["dependencies"]
    )
    assert stated == {"python": TOML["project"]["requires-python"]} | {
        called.get(name, name): bound for name, bound in wanted.items()
    }
