"""Faults: tires in motion that cannot be are refused with what is allowed and what to do, status 2
on the command line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tirelog.cli import run
from tirelog.errors import UsageError
from tirelog.simulation import scenario_of, simulate

from .worlds import tables

CLEAT = {"kind": "cleat", "position_m": 5.0, "height_m": 0.01, "length_m": 0.04}


def moving(**more: Any) -> dict[str, Any]:
    return tables(**{"truth": "coupled_ring", "grid_points": 512, "step_s": 5e-5, **more})


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"truth": "beam", "road": CLEAT}, 'truth = "coupled_ring"'),
        ({"truth": "ring", "load_steps": [{"time_s": 1.0}]}, 'truth = "coupled_ring"'),
        ({"truth": "copuled_ring"}, "nearest: coupled_ring"),
        ({"road": {"kind": "cleet"}}, "nearest: cleat"),
        ({"road": {"kind": "step", "position_m": -1.0}}, "from 0 to"),
        ({"road": {"kind": "profile", "file": 3}}, "text in quotes"),
        ({"load_steps": {"time_s": 1.0}}, "[[load_steps]]"),
        ({"load_steps": [{"time": 1.0}]}, "nearest: time_s"),
        ({"load_steps": [{"time_s": 1.0, "load_N": 0.0}]}, "from 1 to"),
        ({"effects": [{"name": "water_film"}]}, "load_transfer, aero_load"),
        ({"effects": [{"name": "sensor_lag", "form": "other"}]}, "as the catalogue has them"),
        ({"tire": {"contact": "parabola"}}, 'truth = "ring" or "beam"'),
        ({"ramp": {}}, 'truth = "ring" or "beam"'),
        ({"grid_points": 1002}, "multiples of 8"),
        ({"step_s": 0.0}, "step_s = 0.0"),
        ({"tire": {"hub_mass_kg": 0.0}}, "hub_mass_kg = 0.0"),
    ],
)
def test_scenarios_that_are_none(more: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        scenario_of(moving(**more), "case.toml")
    assert said in str(refusal.value)
    assert str(refusal.value).startswith("case.toml: ")
    assert refusal.value.message.count(";") >= 2


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"road": {**CLEAT, "height_m": 0.4, "length_m": 1.0}}, "rises 0.4 m"),
        ({"road": {"kind": "step", "position_m": 3.0, "height_m": -0.7}}, "rises 0.7 m"),
        ({"road": {**CLEAT, "height_m": 0.05, "ramp_m": 0.012}}, "slope of 4.17"),
        ({"road": {**CLEAT, "ramp_m": 0.03}}, "half of its length_m"),
        ({"road": {**CLEAT, "spacing_m": 0.03}}, "shorter than what comes again"),
        ({"road": {"kind": "cleat", "position_m": 3.0}}, "without height_m"),
        ({"road": {"kind": "cleat", "height_m": 0.01}}, "without position_m"),
        ({"road": {"kind": "sine", "amplitude_m": 0.01}}, "without wavelength_m"),
        ({"road": {"kind": "sine", "amplitude_m": 0.1, "wavelength_m": 1.0}}, "rises 0.2 m"),
        ({"road": {"kind": "sine", "amplitude_m": 0.01, "wavelength_m": 0.0}}, "wavelength_m = 0"),
        ({"road": {"kind": "profile"}}, "without a file"),
        ({"road": {"kind": "profile", "file": "no_such_road.txt"}}, "cannot be read"),
        ({"tire": {"line_mass_kg_m": 0.0}}, "mass above zero"),
        ({"step_s": 1e-3}, "unstable"),
        (
            {
                "manoeuvres": [{"duration_s": 1.0, "speed_m_s": 70.0}],
                "tire": {
                    "radial_stiffness_N_m2": 2e5,
                    "tangential_stiffness_N_m2": 2e5,
                    "radial_damping_N_s_m2": 100.0,
                },
            },
            "critical speed",
        ),
        ({"conditions": {"load_N": 200000.0}}, "load that the tire can carry"),
        ({"load_steps": [{"time_s": 0.0, "load_N": 200000.0}]}, "allowed are loads"),
        (
            {
                "manoeuvres": [
                    {"duration_s": 1.0, "speed_m_s": 20.0},
                    {"duration_s": 1.0, "speed_m_s": 2.0},
                ]
            },
            "brake or drive more gently",
        ),
    ],
)
def test_tires_that_cannot_roll_so(more: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        simulate(scenario_of(moving(**more)))
    assert said in str(refusal.value)
    assert refusal.value.message.count(";") >= 2


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("0 0\n1 0\n1.001 0.01\n", None, "slope"),
        ("0 0\n1 0\n1 0.01\n", None, "do not grow"),
        ("0 0\n2 0.01\n1 0.01\n", None, "do not grow"),
        ("0 0\n1 up\n", 2, "no point of a road"),
        ("0 0\n1 nan\n", 2, "no point of a road"),
        ("0 0 0\n1 1 1\n", 1, "no point of a road"),
        ("# nothing\n", None, "fewer than two"),
        ("0 0\n0.3 0.0\n0.4 0.1\n", None, "rises 0.1 m"),
    ],
)
def test_roads_from_files(text: str, line: int | None, said: str, tmp_path: Path) -> None:
    (tmp_path / "road.txt").write_text(text, encoding="utf-8")
    scenario = scenario_of(
        moving(road={"kind": "profile", "file": "road.txt"}), str(tmp_path / "s.toml")
    )
    with pytest.raises(UsageError) as refusal:
        simulate(scenario)
    assert said in str(refusal.value)
    if line is not None:
        assert f"road.txt:{line}:" in str(refusal.value)


def test_command_says_it_with_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'truth = "coupled_ring"\n[road]\nkind = "step"\nposition_m = 2.0\nheight_m = 0.3\n'
        '[[manoeuvres]]\nduration_s = 0.2\nspeed_m_s = 10.0\n[channels.s]\nkind = "strain"\n',
        encoding="utf-8",
    )
    assert run(["simulate", str(scenario), "-o", str(tmp_path / "log.csv")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("tirelog: error: ")
    assert "rises 0.3 m within one diameter" in said
    assert "Traceback" not in said
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]
