"""The section on what is believed: complete, and silent where the chains have not converged."""

import re
from dataclasses import replace

import pytest

from identifiability.report import build_page, render_page
from identifiability.report.analysis import section_posterior
from identifiability.report.results import Page

REASON = "The ensembles disagree: nested R-hat of platform.mx is 1.300 (at most 1.01)."


def doubt(analysis):
    """The same analysis with a posterior that has not converged."""
    summary = analysis.belief.physical
    summary = replace(summary, convergence=replace(summary.convergence, reasons=(REASON,)))
    return replace(analysis, belief=replace(analysis.belief, physical=summary))


def test_the_section_is_there_only_with_a_posterior(believed_analysis):
    for one in (believed_analysis, replace(believed_analysis, belief=None)):
        names = [s.name for s in build_page(one).sections]
        assert ("posterior" in names) == (one.belief is not None)


@pytest.mark.pictures
def test_nothing_of_a_withheld_posterior_is_written(believed_analysis):
    page = Page("", sections=(section_posterior(doubt(believed_analysis)),))
    text = render_page(page).replace("\u00a0", " ")
    assert REASON in text
    assert "correlation" not in re.sub(r"autocorrelation", "", text)
