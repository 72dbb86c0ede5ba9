"""Documents keep all digits: what is read back is what was written."""

import json

from identifiability import Analysis, find_base_parameters


def test_a_result_is_the_same_in_python_and_in_its_file(analysis, tmp_path):
    told = json.loads(analysis.to_json(tmp_path / "result.json").read_text())
    frame = analysis.to_frame()
    values = frame.set_index("name")["value"]
    for row, verdict in zip(told["parameters"], analysis.chosen.verdicts, strict=True):
        assert values[row["name"]] == row["value"]
        assert row["value"] == verdict.value
    errors = [verdict.sigma_label for verdict in analysis.chosen.verdicts]
    assert frame["standard_error"].tolist() == errors


def test_a_fit_is_read_back_with_all_its_digits(analysis, tmp_path):
    again = Analysis.from_json(analysis.to_json(tmp_path / "result.json"), "two-link")
    assert again.values.tolist() == analysis.fit.values.tolist()
    assert again.covariance.tolist() == analysis.fit.covariance.tolist()


def test_a_result_and_who_reads_it_group_parameters_alike(analysis, two_link):
    """Whatever the seed was: of columns that hardly differ chance would decide which is kept."""
    again = find_base_parameters(two_link, analysis.structure.model)
    assert again.names == analysis.base.names
    assert again.G.tolist() == analysis.base.G.tolist()
