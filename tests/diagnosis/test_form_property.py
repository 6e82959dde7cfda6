"""Property: the form of a tire is read out of its log, and an effect is named beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tirelog
from tests.diagnosis.toy import done
from tirelog.cli import run

pytestmark = pytest.mark.xdist_group("form")  # one worker makes what these tests share

RADIUS_M, LOAD_N, HALF_M, RATE_HZ, POINTS = 0.31, 3600.0, 0.056, 2000.0, 2048
STIFFNESS = {"EJ": 3.4, "k": 2.1e6, "mu": 4.5}
FILM, FILM_LENGTH = 0.12, 0.4


def pressure(xi_m, half_m):
    """Pressure over its mean on the patch, flat in the middle."""
    u = xi_m / half_m
    return np.where(np.abs(u) < 1.0, (1.0 - u**6) * 7.0 / 6.0, 0.0)


def parabola(xi_m, half_m):
    return 1.5 * np.maximum(1.0 - (xi_m / half_m) ** 2, 0.0)


def strain(speed, load_N, by_load=0.0, film=0.0):
    """Strain around the wheel from angle -pi on, (POINTS,)."""
    step = 2.0 * np.pi * RADIUS_M / POINTS
    half = HALF_M * np.sqrt(load_N / LOAD_N)
    within = (np.arange(16) + 0.5) / 16 - 0.5  # the edges fall between points
    xi = (np.arange(POINTS)[:, None] - POINTS // 2 + within) * step
    rounder = by_load * (1.0 - load_N / LOAD_N)
    p = (1.0 - rounder) * pressure(xi, half) + rounder * parabola(xi, half)
    ahead = np.maximum(-half - xi, 0.0) / (FILM_LENGTH * half)
    p = (p + film * (speed / 20.0) ** 2 * ahead * np.exp(1.0 - ahead)).mean(axis=1)
    q = 2.0 * np.pi * np.fft.rfftfreq(POINTS, step)
    answer = STIFFNESS["EJ"] * q**4 + STIFFNESS["k"] - STIFFNESS["mu"] * speed**2 * q**2
    modes = np.fft.rfft(np.fft.ifftshift(p * load_N / (p.sum() * step))) / answer
    return -3e-4 * np.fft.fftshift(np.fft.irfft(modes * q**2, POINTS))


def write_log(path, seed, load_per_g, load_N=LOAD_N, by_load=0.0, film=0.0):
    """A log of a drive with five cruises, and its setup beside it."""
    rng = np.random.default_rng(seed)
    targets = rng.permutation([9.0, 12.0, 15.0, 18.0, 21.0]) + rng.uniform(-0.5, 0.5, 5)
    parts, last = [], 8.0
    for target in targets:
        steps = int(abs(target - last) / rng.uniform(1.5, 3.0) * RATE_HZ)
        parts += [np.linspace(last, target, steps), np.full(int(3.0 * RATE_HZ), target)]
        last = target
    speed = np.convolve(np.concatenate(parts), np.ones(301) / 301, "valid")
    acceleration = np.convolve(np.gradient(speed) * RATE_HZ, np.ones(301) / 301, "same")
    angle = np.cumsum(speed) / RATE_HZ / RADIUS_M
    turn = np.floor((angle + np.pi) / (2.0 * np.pi))
    grid = (np.arange(POINTS) - POINTS // 2) * 2.0 * np.pi / POINTS
    read = np.empty(speed.size)
    for number in np.unique(turn):
        rows = np.flatnonzero(turn == number)
        middle = rows[np.argmin(np.abs(angle[rows] - 2.0 * np.pi * number))]
        load = load_N * (1.0 + load_per_g * acceleration[middle] / 9.81)
        load *= 1.0 + 0.004 * rng.standard_normal()
        wave = strain(float(speed[middle]), load, by_load, film)
        read[rows] = np.interp(angle[rows] - 2.0 * np.pi * number, grid, wave)
    noisy = 1e6 * read + 0.7 * rng.standard_normal(read.size)
    lines = (f"{i / RATE_HZ:.4f},{value:.3f}" for i, value in enumerate(noisy))
    path.write_text("time_s,strain\n" + "\n".join(lines) + "\n", encoding="utf-8")
    path.with_suffix(".toml").write_text(
        f"[tire]\nunloaded_radius_m = {RADIUS_M * 1.02}\nrolling_radius_m = {RADIUS_M}\n"
        f"[conditions]\nload_N = {load_N}\ndriven = true\nwater_depth_mm = 1.0\n"
        '[channels.s]\nkind = "strain"\nsource = "strain"\nunit = "microstrain"\n'
        'surface = "outer"\n',
        encoding="utf-8",
    )
    return path


def model_of(folder):
    """The path of a new model of a beam for the logs of a folder."""
    model = str(folder / "beam.toml")
    done("model", "new", "--setup", folder / "l11.toml", "-o", model)
    done("model", "set", model, "form=auto", "-o", model)
    return model


def measured(folder, load_per_g):
    """The paths of two logs and of a new model of a beam."""
    logs = [str(write_log(folder / f"l{seed}.csv", seed, load_per_g)) for seed in (11, 12)]
    return logs, model_of(folder)


def of_two_loads(folder, film=0.0):
    """The same under two loads, which the pressure follows."""
    logs = [
        str(write_log(folder / f"l{seed}.csv", seed, 0.0, share * LOAD_N, 2.5, film))
        for seed, share in ((11, 0.84), (12, 1.16))
    ]
    return logs, model_of(folder)


def form(folder, logs, model):
    """The rows that `form` writes of the contact pressure, and of the stiffness."""
    done("form", *logs, "--model", model, "-o", folder / "form.csv")
    rows = np.genfromtxt(
        folder / "form.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    assert set(rows["quality"]) == {"ok"}
    pressed = rows["quantity"] == "contact_pressure"
    return rows[pressed], rows[~pressed]


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    return measured(tmp_path_factory.mktemp("bare"), 0.0)


def test_the_pressure_is_that_of_the_truth(bare, tmp_path):
    own, waves = form(tmp_path, *bare)
    mean = LOAD_N / (2.0 * HALF_M)
    missed = own["contact_pressure_N_m"] / mean - pressure(own["xi_m"], HALF_M)
    formula = own["contact_pressure_formula_N_m"] / mean - pressure(own["xi_m"], HALF_M)
    assert np.sqrt((missed**2).mean()) < 0.03 < 0.2 * np.sqrt((formula**2).mean())
    off = np.abs(own["contact_pressure_N_m"] - mean * pressure(own["xi_m"], HALF_M))
    assert (off <= 2.0 * own["contact_pressure_se_N_m"])[np.abs(own["xi_m"]) < HALF_M].mean() > 0.7
    assert own["contact_pressure_N_m"].min() > -0.02 * mean
    q = 2.0 * np.pi / waves["wavelength_m"]
    truth = STIFFNESS["EJ"] * q**4 + STIFFNESS["k"]
    assert np.abs(waves["stiffness_N_m2"] / truth - 1.0).max() < 0.1


def answer_json(capsys, *arguments):
    """What a command answers as JSON."""
    capsys.readouterr()
    assert run([*arguments, "--format", "json", "--quiet"]) == 0
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


@pytest.mark.slow
def test_a_fit_has_the_form_that_compare_reports(bare, tmp_path, capsys):
    logs, model = bare
    fitted = str(tmp_path / "fitted.toml")
    before = answer_json(capsys, "compare", *logs, "--model", model)
    scale = before["parameters"]["line_mass_kg_m"]["value"] / STIFFNESS["mu"]
    for name, true in (
        ("patch_half_length_m", HALF_M),
        ("foundation_stiffness_N_m2", STIFFNESS["k"] * scale),
    ):
        fit = before["parameters"][name]
        assert 10.0 * fit["se"] < abs(fit["value"] - true) < 2.0 * fit["se_with_form"]
    formed = before["with_nuisances"]
    assert formed["nuisances"] == ["form"]
    assert formed["rmse_heldout"] < 1.05 * formed["noise_floor"] < 0.5 * before["rmse_heldout"]
    done("model", "fit", *logs, "--model", model, "-o", fitted)
    text = Path(fitted).read_text(encoding="utf-8")
    assert "[[effects]]" not in text
    assert '[form]\nuse = "auto"\npressure_2 = {value' in text
    after = answer_json(capsys, "compare", *logs, "--model", fitted)
    assert after["with_nuisances"] is None
    assert after["rmse_heldout"] == pytest.approx(formed["rmse_heldout"], rel=0.01)
    done("model", "set", fitted, "form=off", "-o", fitted)
    assert Path(fitted).read_text(encoding="utf-8").endswith('[form]\nuse = "off"\n')
    done("model", "fit", *logs, "--model", fitted, "-o", fitted)
    assert "pressure_2" not in Path(fitted).read_text(encoding="utf-8")


def test_a_form_that_is_on_is_fitted(bare, tmp_path):
    logs, model = bare
    asked = str(tmp_path / "on.toml")
    done("model", "set", model, "form=on", "-o", asked)
    done("model", "fit", *logs, "--model", asked, "-o", asked)
    shape = tirelog.load_model(asked).parameters["form.pressure_3"]
    assert shape.se is not None
    assert shape.value > 3.0 * shape.se  # fitted, and not by chance


@pytest.mark.slow
def test_a_form_is_no_missing_effect(bare):
    logs, path = bare
    model = tirelog.load_model(path)
    found = tirelog.measure(logs, model)
    result = tirelog.diagnose(found, model)
    assert result.verdict == "nothing_missing"
    assert [n.nuisance for n in result.nuisances if n.stayed] == ["form"]
    # a pressure that leans is P1 - P3 of the series at any load; hysteresis is no stiffness
    held = result.to_json()["form_may_hold"]
    assert held["pressure_offset"] == []
    assert "hysteresis" not in held
    without = tirelog.diagnose(found, model.with_nuisance("form", "off"))
    assert without.verdict == "unknown"
    assert without.to_json()["form_may_hold"] == {}


@pytest.mark.slow
def test_a_form_may_follow_the_load(tmp_path, capsys):
    """Two logs of two loads: no effect is named, and the pressure at their mean is read."""
    logs, model = of_two_loads(tmp_path)
    answer = answer_json(capsys, "diagnose", *logs, "--model", model)
    assert (answer["verdict"], answer["selected"]) == ("nothing_missing", [])
    assert answer["nuisances"]["form"]["stayed"]
    own, _ = form(tmp_path, logs, model)
    off = own["contact_pressure_N_m"] * 2.0 * HALF_M / LOAD_N - pressure(own["xi_m"], HALF_M)
    assert np.sqrt((off**2).mean()) < 0.05


@pytest.mark.slow
def test_an_effect_that_a_form_has_learnt_is_named(tmp_path, capsys):
    """Beside a form that was fitted without it, slopes show another effect in its place."""
    logs, model = of_two_loads(tmp_path, FILM)
    answer = answer_json(capsys, "diagnose", *logs, "--model", model)
    assert (answer["verdict"], answer["selected"]) == ("missing", ["water_film"])
    (named,) = [e for e in answer["effects"] if e["selected"]]
    assert named["p_adjusted"] <= 0.01
    strengths = {name: number["value"] for name, number in named["strengths"].items()}
    assert strengths == pytest.approx({"amplitude": FILM, "length": FILM_LENGTH}, rel=0.1)
