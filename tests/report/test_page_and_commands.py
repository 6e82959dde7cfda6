"""Property: the numbers on a page are those of the commands that it prints, also if a nuisance
comes in beside the model.
"""

import gzip
import html
import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import tirelog
from tests.cli.conftest import tirelog as command
from tests.report.test_page import data, numbers
from tirelog.cli import run

__all__ = ["command"]

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share

SAMPLES = Path(__file__).parents[2] / "sample_data"
#: amplitude of the run-out that is added to a sample log, far above its noise [microstrain]
_RUN_OUT = 40.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log whose wheel has run-out, a beam, and the page of both."""
    folder = tmp_path_factory.mktemp("wheel")
    centres = tirelog.speed(SAMPLES / "hidden_1.csv.gz")["time_s"].to_numpy()
    with gzip.open(SAMPLES / "hidden_1.csv.gz", "rt") as stream:
        head, rows = [next(stream) for _ in range(3)], [line.split(",") for line in stream]
    time = np.array([float(row[0]) for row in rows])
    turn = 2.0 * np.pi * np.interp(time, centres, np.arange(centres.size))
    # a grating of gain 1.27 at 1550 nm, as its setup says
    added = 1e-6 * _RUN_OUT * np.cos(turn) * 1550.0 / 1.27
    with (folder / "wheel.csv").open("w") as log:
        log.writelines(head)
        for (stamp, value), more in zip(rows, added, strict=True):
            log.write(f"{stamp},{float(value) + more:.4f}\n" if value.strip() else f"{stamp},\n")
    shutil.copy(SAMPLES / "hidden_1.toml", folder / "wheel.toml")
    model, page = str(folder / "m.toml"), str(folder / "page.html")
    assert run(["model", "new", "--setup", str(folder / "wheel.toml"), "-o", model, "--quiet"]) == 0
    log_file = str(folder / "wheel.csv")
    assert run(["report", log_file, "--model", model, "-o", page, "--quiet"]) == 0
    return folder


def said(folder, section):
    """The text of a section of the page, and the command that it is made with."""
    page = (folder / "page.html").read_text()
    found = re.search(rf'<section id="{section}".*?</section>', page, re.S)
    assert found
    made = re.search(r"Made with <code>(.*?)</code>", found[0])
    assert made
    text = re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", found[0])))
    return text, shlex.split(html.unescape(made[1]))[1:]


def answer(command, words):
    """What a command that the page prints gives."""
    outcome = command(*words, "--format", "json")
    assert outcome.status == 0
    return dict(json.loads(outcome.out))


def test_the_comparison_is_the_command_s(folder, command):
    text, words = said(folder, "model")
    found = answer(command, words)
    beside = found["with_nuisances"]
    assert beside["nuisances"] == ["wheel"]
    assert beside["rmse_heldout"] < 0.5 * found["rmse_heldout"]
    for errors in (found, beside):
        held, fitted, floor = (
            f"{1e6 * errors[name]:.3g}" for name in ("rmse_heldout", "rmse", "noise_floor")
        )
        assert (
            f"held out {held} microstrain, fit {fitted}, noise floor {floor}, reduced chi-square "
            f"{errors['reduced_chi2']:.3g}"
        ) in text
    held = f"{1e6 * found['rmse_heldout']:.3g}"
    assert f"manoeuvres held out from the fit: {held} microstrain" in text
    for name, parameter in found["parameters"].items():
        assert f"{name} {parameter['value']:.4g}" in text


def test_the_diagnosis_is_the_command_s(folder, command):
    text, words = said(folder, "diagnosis")
    found = answer(command, words)
    names = ("rmse_heldout_before", "rmse_heldout_after", "rmse_heldout_without_nuisances")
    before, after, without = (f"{1e6 * found[name]:.3g}" for name in names)
    assert f"Held-out error {before} -> {after} microstrain" in text
    assert f"{without} without" in text
    assert found["sentence"] in text
    assert f"Next: {found['next_command']}" in text
    card, _ = said(folder, "answer")
    assert f"your model {without} microstrain" in card
    assert f"{before} microstrain" in card
    assert f"{after} microstrain" in card
    _, compared = said(folder, "model")
    assert without == f"{1e6 * answer(command, compared)['rmse_heldout']:.3g}"
    ranked = data(folder / "page.html")["figures"]["ranking"]["traces"]
    drawn = {name: x for t in ranked for name, x in zip(t["y"], numbers(t["x"]), strict=True)}
    shares = {c["effect"]: 100 * c["excess_removed"] for c in found["effects"]}
    assert drawn == pytest.approx(shares, rel=1e-3, abs=1e-2)
