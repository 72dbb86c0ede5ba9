"""The sections on what is believed: complete, and silent where the chains have not converged."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.rules import Thresholds
from identifiability.report import build_analysis_page, render_page
from identifiability.report.analysis_report import section_physics
from identifiability.report.belief import (
    forest_gallery,
    forest_layers,
    section_posterior,
    section_standard,
    strongest_pairs,
)
from identifiability.report.results import Page
from identifiability.workflows.analyze.belief import Source
from identifiability.workflows.analyze.result import parameter_table

REASON = "The ensembles disagree: nested R-hat of platform.mx is 1.300 (at most 1.01)."
NAMES = ("posterior", "standard")


def sections(analysis):
    return {s.name: s for s in (section_posterior(analysis), section_standard(analysis))}


def doubt(analysis, *names):
    """The same analysis with posteriors that have not converged."""
    belief = analysis.belief
    for name in names:
        summary = getattr(belief, name)
        convergence = replace(summary.convergence, reasons=(REASON,))
        belief = replace(belief, **{name: replace(summary, convergence=convergence)})
    return replace(analysis, belief=belief)


def html_of(analysis):
    page = Page("", sections=tuple(sections(analysis).values()))
    return render_page(page).replace("\u00a0", " ")


def test_the_sections_are_there_only_with_a_posterior(believed_analysis):
    names = [
        [s.name for s in build_analysis_page(one).sections if s.name in NAMES]
        for one in (believed_analysis, replace(believed_analysis, belief=None))
    ]
    assert names == [[*NAMES], []]


def sensitive(analysis, share):
    """Return an analysis in which the prior moves the intervals with bodies so far, in sd."""
    belief = analysis.belief
    prior_sensitivity = np.broadcast_to(
        np.asarray(share, float), belief.physical.prior_sensitivity.shape
    )
    return replace(
        analysis,
        belief=replace(
            belief, physical=replace(belief.physical, prior_sensitivity=prior_sensitivity)
        ),
    )


def test_every_road_has_its_interval(believed_analysis):
    believed_analysis = sensitive(believed_analysis, np.linspace(0, 0.3, 12))
    layers, stated = forest_layers(believed_analysis)
    assert list(layers) == [
        "white σ", "robust σ", "block bootstrap", "posterior with signs", "posterior with bodies",
        "label",
    ]  # fmt: skip
    np.testing.assert_allclose(layers["robust σ"], np.outer(np.ones(12), [0, -1.96, 1.96]))
    physical = believed_analysis.belief.physical
    assert 6 < physical.stated.sum() < 12
    assert np.isnan(layers["posterior with bodies"][~physical.stated]).all()
    shown = layers | {"posterior with bodies": layers["posterior with bodies"][physical.stated]}
    for name, values in shown.items():
        assert (np.diff(values[:, [1, 0, 2]], axis=1) > 0).all()
        assert name == "label" or np.abs(values).max() < 6
    verdicts = believed_analysis.chosen.verdicts
    wider = np.array([v.sigma_label / v.sigma_robust for v in verdicts])
    np.testing.assert_allclose(layers["label"], np.outer(wider, [0, -1.96, 1.96]), atol=1e-12)
    assert np.isfinite(stated).all()


def test_a_reduced_models_table_shows_both_what_it_fits_and_what_its_labels_say(believed_analysis):
    small, full = (
        parameter_table(believed_analysis, m)
        for m in (believed_analysis.chosen, believed_analysis.full)
    )
    titles = [c.title for c in small.columns]
    assert [t for t in titles if t not in [c.title for c in full.columns]] == ["σ label"]
    row = next(r for r in small.rows if r[0].text == "slider1.Jr")
    verdict = next(v for v in believed_analysis.chosen.verdicts if v.name == "slider1.Jr")
    file = row[titles.index("robot file")]
    label, robust = (float(row[titles.index(t)].sort_key) for t in ("σ label", "σ robust"))
    assert label == pytest.approx(verdict.sigma_label_percent, rel=1e-4)
    assert label > 2 * robust
    assert float(file.sort_key) == pytest.approx(verdict.projected, rel=1e-4)
    assert (file.text, file.note) == ("472", "label 483")


def test_what_the_motion_leaves_open_is_seen_from_the_posterior(believed_analysis):
    chosen = believed_analysis.chosen
    k = int(believed_analysis.belief.physical.stated.argmax())
    verdicts = list(chosen.verdicts)
    verdicts[k] = replace(verdicts[k], sigma=np.inf, terms={"noise": np.inf, "omitted": 0.0})
    models = [*believed_analysis.models]
    models[believed_analysis.selected] = replace(chosen, verdicts=tuple(verdicts))
    layers, _ = forest_layers(replace(believed_analysis, models=tuple(models)))
    assert np.isnan(layers["white σ"][k]).all()
    assert np.isnan(layers["block bootstrap"][k]).all()
    assert layers["posterior with bodies"][k, 0] == 0
    assert np.isfinite(layers["posterior with signs"][k]).all()


def test_intervals_that_the_prior_decides_are_named_and_withheld(believed_analysis):
    believed_analysis = sensitive(believed_analysis, np.linspace(0, 0.3, 12))
    physical = believed_analysis.belief.physical
    (only,) = sections(believed_analysis)["posterior"].blocks[0].notes
    left = np.array(believed_analysis.chosen.submodel.columns)[~physical.stated]
    assert only.title.startswith(f"The prior decides {len(left)} of 12 intervals of the posterior")
    assert all(name in only.text for name in left)
    calm = sensitive(believed_analysis, 0.0)
    assert not hasattr(sections(calm)["posterior"].blocks[0], "notes")
    assert np.isfinite(forest_layers(calm)[0]["posterior with bodies"]).all()


@pytest.mark.pictures
def test_every_parameter_has_its_row_and_long_models_are_cut(believed_analysis):
    full = next(k for k, m in enumerate(believed_analysis.models) if len(m.submodel) == 37)
    unsure = doubt(believed_analysis, "signs", "physical")
    pictures = forest_gallery(replace(unsure, selected=full)).pictures
    rows = [len(p.figure.axes[0].texts) for p in pictures]
    assert (sum(rows), max(rows)) == (37, 13)


def test_the_strongest_pairs_come_first():
    rho = np.array([[1, 0.5, -0.9], [0.5, 1, 0.1], [-0.9, 0.1, 1]])
    assert strongest_pairs(rho) == [(0, 2), (0, 1)]


def test_every_standard_parameter_is_shown_once_and_listed(believed_analysis):
    known = believed_analysis.belief.standard
    table = sections(believed_analysis)["standard"].blocks[-1].blocks[0]
    assert [row[0].text for row in table.rows] == list(known.names)
    assert dict(table.words) == {
        s.value: known.source.count(s) for s in Source if s in known.source
    }
    assert all(
        known.contraction[k] > Thresholds.contraction
        for k in range(85)
        if known.source[k] is Source.DATA
    )


@pytest.mark.parametrize("names", [("physical",), ("signs",), ("signs", "physical")])
def test_a_chain_that_has_not_converged_is_withheld_with_its_reasons(believed_analysis, names):
    analysis = doubt(believed_analysis, *names)
    found, layers = sections(analysis), forest_layers(analysis)[0]
    notes = found["posterior"].blocks[0].notes
    assert [n.text for n in notes if n.level == "warning"] == [REASON] * len(names)
    assert all("withheld" in n.title for n in notes)
    assert ("posterior with signs" in layers) == ("signs" not in names)
    assert ("posterior with bodies" in layers) == ("physical" not in names)
    assert (found["standard"].blocks[0].kind == "notes") == ("physical" in names)
    table = found["posterior"].blocks[-1]
    assert [row[-1].text for row in table.rows].count("no") == len(names)


@pytest.mark.pictures
def test_nothing_of_a_withheld_posterior_is_written(believed_analysis):
    text = html_of(doubt(believed_analysis, "signs", "physical"))
    known = believed_analysis.belief.standard
    assert REASON in text
    assert "correlation" not in re.sub(r"autocorrelation", "", text)
    assert known.names[4] not in text


def test_a_motion_that_leaves_parameters_open_has_a_note_instead(believed_analysis):
    belief = replace(believed_analysis.belief, signs=None, physical=None, standard=None,
                     note="the motion leaves parameters undetermined")  # fmt: skip
    text = html_of(replace(believed_analysis, belief=belief))
    assert "No posterior with signs." in text
    assert "The motion leaves parameters undetermined." in text


def test_bodies_that_are_held_at_the_edge_are_named(believed_analysis):
    worst = replace(believed_analysis, selected=0, belief=replace(believed_analysis.belief))
    edge = ("leg1_upper", "platform")  # the weak prior keeps the nearest real robot away from it
    nearest = replace(worst.chosen.physical.nearest, active_bodies=edge)
    physical = replace(worst.chosen.physical, nearest=nearest)
    worst = replace(worst, models=(replace(worst.chosen, physical=physical), *worst.models[1:]))
    assert f"held at the edge: {' and '.join(edge)}." in section_physics(worst).lead
    missing = replace(physical, nearest=None)
    models = (replace(worst.chosen, physical=missing), *worst.models[1:])
    assert "No body" in section_physics(replace(worst, models=models)).lead


@pytest.mark.everything
def test_odd_robots_have_the_same_sections(chain_analysis, believe_small, hostile_names):
    text = html_of(believe_small(chain_analysis(hostile_names)))
    assert text.count("<script") == 1
    assert "<img" not in text
    assert text.count("<section") == 2


def test_thresholds_and_words_are_explained(believed_analysis):
    html = render_page(build_analysis_page(believed_analysis))
    for text in ("constraint-determined", "prior-dominated", "contraction", "room of a body"):
        assert text in html
    assert "share to which bodies narrow an open variance" in html
