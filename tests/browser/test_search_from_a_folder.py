"""The documentation can be searched where its pages are opened from a folder, offline."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.everything  # it builds the site
def test_pages_of_a_folder_can_be_searched(visit, tmp_path, monkeypatch):
    commands = pytest.importorskip("mkdocs.commands.build", reason="needs the extra 'docs'")
    config = pytest.importorskip("mkdocs.config", reason="needs the extra 'docs'")
    monkeypatch.setenv("NO_MKDOCS_2_WARNING", "1")
    site = tmp_path / "site"
    commands.build(config.load_config(str(ROOT / "mkdocs.yml"), site_dir=str(site)))
    with visit(site / "tutorials" / "payload.html") as seen:
        seen.page.keyboard.press("f")
        seen.page.keyboard.type("payload")
        seen.page.wait_for_function(
            "document.querySelectorAll('.md-search-result__item').length > 1"
        )
        assert seen.complaints == []
        assert [r for r in seen.requests if not r.startswith("file:")] == []
