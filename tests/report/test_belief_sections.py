"""The sections on what is believed: complete, and silent where the chains have not converged."""

import re
from dataclasses import replace

import pytest

from identifiability.estimation.rules import Thresholds
from identifiability.report import build_analysis_page, render_page
from identifiability.report.belief import section_posterior, section_standard
from identifiability.report.results import Page
from identifiability.workflows.analyze.belief import Source

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


@pytest.mark.pictures
def test_nothing_of_a_withheld_posterior_is_written(believed_analysis):
    text = html_of(doubt(believed_analysis, "signs", "physical"))
    known = believed_analysis.belief.standard
    assert REASON in text
    assert "correlation" not in re.sub(r"autocorrelation", "", text)
    assert known.names[4] not in text
