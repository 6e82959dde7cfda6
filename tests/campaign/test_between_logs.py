"""Property: effects that only differences of load or water between logs reveal are found."""

import pytest

from benchmarks.between_logs import HIDDEN, make, named_alone, of_campaign, of_log, says_so
from tirelog.cli import run


@pytest.mark.slow
@pytest.mark.parametrize("effect", list(HIDDEN))
def test_a_campaign_finds_what_one_log_does_not(effect, tmp_path):
    manifest, logs = make(tmp_path / "campaign", effect, seed=31)
    if effect == "stiffening":  # its nonlinear foundation takes long
        manifest.write_text(
            manifest.read_text().replace('["compare", "diagnose", "ladder"]', '["diagnose"]')
        )
    whole = of_campaign(manifest)
    assert named_alone(whole, effect), (whole["verdict"], whole["selected"])
    word = {"stiffening": "load", "water_film": "water depth"}[effect]
    assert word not in whole["note"].partition("What follows")[0]
    # in 1 mm of water, of logs[2], the film's own shape names it (a rival leaves chi-square 6.9);
    # in half of it it does not
    one = of_log(logs[{"stiffening": 2, "water_film": 1}[effect]], manifest.parent / "beam.toml")
    assert not named_alone(one, effect)
    assert says_so(one, effect), (one["verdict"], one["selected"], one["note"])
    if effect == "water_film":
        report_shows(whole, manifest.parent / "results", tmp_path / "page.html")


def report_shows(whole, results, page):
    """The sections that a report on logs with a model has, made of the campaign's folder alone."""
    assert run(["report", "--campaign", str(results), "-o", str(page), "--quiet"]) == 0
    text = page.read_text()
    for section in ("campaign", "model", "diagnosis", "ladder"):
        assert f'<section id="{section}">' in text
    assert whole["sentence"] in text
