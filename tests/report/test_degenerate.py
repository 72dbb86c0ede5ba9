"""Analyses that show little, much, or something odd still give a report that can be read."""

import pytest

from identifiability.report import build_page, render_page


@pytest.mark.parametrize("joints", [["only"], ["a", "b"]])
def test_one_model_and_few_joints_suffice(chain_analysis, one_model, joints):
    page = build_page(chain_analysis(joints, one_model))
    assert "there was nothing to choose from" in render_page(page)
