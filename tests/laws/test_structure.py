"""A `Structure` owns what follows from a robot under a model, and nobody else derives it."""

import ast
from pathlib import Path

import numpy as np
import pytest

import identifiability
from identifiability.foundation.names import GROUPED_KINDS
from identifiability.physical.fitted_model import physical_set
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters
from identifiability.robot import Robot

#: What makes a structure, and the columns that it makes.
MAKERS = {
    "Structure", "Structure.of", "find_base_parameters", "Regression", "LogPart", "add_beside",
}  # fmt: skip


@pytest.fixture(scope="module")
def two_link():
    return Robot.load("two-link")


@pytest.fixture(scope="module")
def structure(two_link):
    return Structure.of(two_link, Model.of("rigid_body", "viscous_friction", "payload"))


def test_values_signs_and_bodies_are_those_of_the_robot_file(structure, two_link):
    base = find_base_parameters(two_link, structure.model)
    np.testing.assert_array_equal(structure.G, base.G)
    for k, parameter in enumerate(base.parameters):
        assert structure.columns[k] == parameter.name
        assert structure.nominal[k] == two_link.nominal.get(parameter.name, 0.0)
        assert structure.nonnegative[k] == parameter.nonnegative
    for row, value in enumerate(structure.nominal_base):
        stated = sum(c * two_link.nominal.get(p.name, 0.0) for c, p in base.terms(row))
        assert value == pytest.approx(stated, rel=1e-12, abs=1e-15)


def test_the_ten_columns_of_every_body_and_load_are_found_by_name(structure, two_link):
    last = two_link.bodies[-1]
    assert list(structure.bodies) == [*(f"{b}." for b in two_link.bodies), f"{last}.payload_"]
    for stem, columns in zip(structure.bodies, structure.inertial, strict=True):
        assert [structure.columns[k] for k in columns] == [
            f"{stem}{kind}" for kind in GROUPED_KINDS
        ]


def test_what_follows_is_derived_once_and_cannot_be_written_to(structure):
    assert physical_set(structure) is physical_set(structure)
    for name in ("nominal", "nominal_base", "nonnegative", "inertial"):
        found = getattr(structure, name)
        assert found is getattr(structure, name)
        with pytest.raises(ValueError, match="read-only"):
            found[...] = 0


def arguments(node):
    """Return the types of a function's arguments, or of a class's fields."""
    if isinstance(node, ast.ClassDef):
        return {ast.unparse(s.annotation) for s in node.body if isinstance(s, ast.AnnAssign)}
    every = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
    return {ast.unparse(a.annotation) for a in every if a.annotation is not None}


def beside(tree):
    """Yield what takes a robot beside its base parameters or its model."""
    owners = {id(n): c.name for c in ast.walk(tree) if isinstance(c, ast.ClassDef) for n in c.body}
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            given = {t.strip("'\"").removesuffix(" | None") for t in arguments(node)}
            known = any(t in ("BaseParameters", "Model") or "[Model," in t for t in given)
            if known and given & {"Robot", "KnownRobot", "RobotLike"}:
                yield f"{owners[id(node)]}.{node.name}" if id(node) in owners else node.name


@pytest.fixture(scope="module")
def sources():
    """Every file of the package, by its place in it."""
    root = Path(identifiability.__file__).parent
    return {
        f.relative_to(root).as_posix(): ast.parse(f.read_text(encoding="utf-8"))
        for f in root.rglob("*.py")
    }


def test_nobody_takes_a_robot_beside_its_base_parameters_or_its_model(sources):
    assert {n for tree in sources.values() for n in beside(tree)} == MAKERS


def by_name(tree):
    """Yield the lines that import a module of the package by its name, but in a lazy `__getattr__`.

    Modules of a file's own folder are no arrow: relative names, and those after ``__name__``.
    """
    lazy = {
        id(n)
        for f in ast.walk(tree)
        if isinstance(f, ast.FunctionDef) and f.name == "__getattr__"
        for n in ast.walk(f)
    }
    for node in ast.walk(tree):
        called = isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2]
        if called in ("import_module", "__import__") and id(node) not in lazy:
            name = ast.unparse(node.args[0]).lstrip("f").strip("'\"")
            if not name.startswith((".", "{__name__}.")):
                yield node.lineno


def test_no_module_of_the_package_is_imported_by_a_string(sources):
    assert {f: lines for f, tree in sources.items() if (lines := list(by_name(tree)))} == {}


#: What mends or reads logs, and the file that asks it: the registry of checks, and who reads.
ONCE = {
    "mend_log": {"quality/mends.py"},
    "unwrap_log": {"quality/mends.py"},
    "drop_stuck": {"quality/mends.py"},
    "drop_repeats": {"quality/mends.py"},
    "mend": {"workflows/opening.py"},
    "read_logs": {"workflows/opening.py"},
}


def test_logs_are_read_mended_and_opened_in_one_place_for_every_verb(sources):
    found = {name: set() for name in ONCE}
    for file, tree in sources.items():
        if file.startswith(("workflows/", "quality/")):
            for node in ast.walk(tree):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                    if node.func.id in found:
                        found[node.func.id].add(file)
                elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".each"):
                    for name in [a.id for a in node.args if isinstance(a, ast.Name)]:
                        found.get(name, set()).add(file)
    found["mend"].discard("quality/registry.py")
    assert found == ONCE
