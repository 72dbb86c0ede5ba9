"""Effort that is compensated for gravity: what is said mends it, and weight is measured."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import analyze, prepare_log
from identifiability.regression.structure import Structure

from ..marks import everything
from ..roads import weight


def with_sidecar(structure, load_text, torque):
    """The same robot, with what its sidecar says of torque."""
    shipped = structure.robot
    known = f"{shipped.sidecar.read_text()}\n[torque]\n{torque}\n"
    robot = load_text(shipped.path.read_text(), shipped.path.suffix[1:], known)
    return Structure.of(robot, structure.model)


@pytest.mark.parametrize("good", ["two-link", everything("six-dof-arm")], indirect=True)
def test_what_is_said_of_compensated_effort_mends_it(good, load_text, rejected):
    structure, log = good
    light = replace(log, tau=log.tau - weight(structure.robot, log))
    hint = analyze(structure.robot, light, replicates=0).hints[0]
    assert "compensated for gravity" in hint
    assert "compensated = true under [torque]" in hint
    mended = with_sidecar(structure, load_text, "compensated = true")
    assert not any("compensated" in x for x in analyze(mended.robot, light, replicates=0).hints)
    ours, plain = (prepare_log(s.robot, x) for s, x in ((mended, light), (structure, log)))
    assert_allclose(ours.tau, plain.tau, atol=1e-3 * np.abs(log.tau).max())
    assert any("was added to the measured torque" in note for note in ours.notes)
    said = with_sidecar(structure, load_text, "compensated = false").robot
    assert not any("compensated" in x for x in analyze(said, light, replicates=0).hints)
    with rejected(r"\[torque.compensated\] names 'joint_9'"):
        with_sidecar(structure, load_text, 'compensated = ["joint_9"]')
