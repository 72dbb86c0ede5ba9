"""Analyses that show little, much, or something odd still give a report that can be read."""

import re

import pytest

from identifiability.report import build_analysis_page, render_page


def render(analysis) -> str:
    return render_page(build_analysis_page(analysis))


def cells(analysis, section: int = 0):
    return build_analysis_page(analysis).sections[section].blocks[1].rows


def test_hostile_joint_names_are_harmless(chain_analysis, hostile_names):
    html = render(chain_analysis(hostile_names, held=1))
    assert html.count("<script") == 1
    assert "<img" not in html
    assert html.count("<svg") == html.count("</svg>")
    assert "a$b$c_{d}" in html


def test_a_robot_that_stands_still_is_a_result(chain_analysis):
    analysis = chain_analysis(["a", "b"], amplitude=0.0)
    page = build_analysis_page(analysis)
    answers = page.summary[0].answers
    assert [a.short for a in answers[::2]] == ["Nothing, and none.", "No."]
    assert answers[2].text.startswith("Nothing is identifiable")
    line = f"identifiability inspect {analysis.robot.path} 'log 1'"
    assert [c for _, c in answers[3].commands] == [line]
    for row in cells(analysis):
        assert [c.text for c in row[1:3]] == ["—", "—"]
        assert row[5].text == "—"
    assert "undefined" not in render_page(page)


def test_torque_that_never_varies_has_no_relative_error(chain_analysis):
    analysis = chain_analysis(["a"], torque=5.0)
    html = render(analysis)
    assert "Nothing is identifiable, because the measured torque never changes" in html
    assert build_analysis_page(analysis).summary[0].answers[1].short == "There is no error to tell."
    assert not re.search(r">[^<]*\bnan\b[^<]*<", html)


@pytest.mark.parametrize("joints", [["only"], ["a", "b"]])
def test_one_model_and_few_joints_suffice(chain_analysis, one_model, joints):
    html = render(chain_analysis(joints, ladder=one_model))
    assert "there was nothing to choose from" in html
    assert 'id="full-model"' not in html


def test_noise_free_logs_have_no_sigma_to_speak_of(chain_analysis):
    assert "±" in render(chain_analysis(["a", "b"], noise=0.0))


def test_many_logs_get_a_row_each(chain_analysis):
    analysis = chain_analysis(["a", "b"], logs=7, held=5, samples=60)
    blocks = {s.name: s.blocks for s in build_analysis_page(analysis).sections}
    assert len(blocks["prediction"][-1].rows) == 7 + 5
    roles = [r[1].text for r in blocks["motion"][0].rows]
    assert roles == ["fitted"] * 7 + ["held out"] * 5
    assert len(blocks["provenance"][0].rows) >= 13  # hashes, although names repeat


@pytest.mark.everything
@pytest.mark.parametrize("joints", [8, pytest.param(24, marks=pytest.mark.everything)])
def test_many_joints_fit_into_a_page(chain_analysis, one_model, joints):
    ladder = one_model.model_copy(deep=True)
    ladder.models[0].effects = ["viscous_friction", "coulomb_asymmetry", "actuator_inertia"]
    analysis = chain_analysis([f"j{k}" for k in range(joints)], held=1, ladder=ladder, samples=600)
    html = render(analysis)
    assert len(html.encode()) < 700_000 + 33_000 * joints
