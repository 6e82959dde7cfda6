"""Faults: nuisances that cannot be carried out are refused with what is allowed."""

from __future__ import annotations

from typing import Any

import pytest

from tirelog.errors import UsageError
from tirelog.simulation import load_scenario, scenario_of

from .worlds import tables


def channel(**more: Any) -> dict[str, Any]:
    return {"channels": {"s": {"kind": "fbg_strain", **more}}}


def nuisance(name: str, **values: Any) -> dict[str, Any]:
    return {"nuisances": {name: values}}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"nuisance": {}}, "nearest: nuisances"),
        ({"nuisances": 3}, "[nuisances] is not a table; allowed are run_out,"),
        ({"nuisances": {"runout": {}}}, "nearest: run_out"),
        ({"nuisances": {"run_out": [3.0]}}, "[nuisances.run_out] is not a table"),
        (nuisance("run_out", amplitude=3.0), "unknown key 'amplitude' in [nuisances.run_out]"),
        (nuisance("run_out", amplitudes_microstrain=3.0), "at most 3 numbers from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[1.0] * 4), "at most 3 numbers"),
        (nuisance("run_out", amplitudes_microstrain=[-1.0]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[float("nan")]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=["3"]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[True]), "from 0 to 1000"),
        (nuisance("run_out", phases_deg=[10.0]), "1 phases_deg for 0 harmonics"),
        (nuisance("force_variation", shares=[1.2]), "from 0 to 0.1"),
        (nuisance("force_variation", shares=[0.01], phases_deg=[0.0, 0.0]), "one for each"),
        (nuisance("force_variation", shares=[0.01], phases_deg=[999.0]), "from -360 to 360"),
        (nuisance("load_wander", share=0.5), "from 0 to 0.1"),
        (nuisance("load_wander", time_constant_s=0.0), "from 1 to 10000"),
        (nuisance("warming", stiffness_per_K=1.0), "from -0.02 to 0.02"),
        (
            nuisance("warming", stiffness_per_K=-0.02) | {"conditions": {"warm_up_K": 50.0}},
            "leaves 0 of it after warm_up_K = 50; allowed is 0.3 at least",
        ),
        (
            nuisance("warming", patch_length_per_K=-0.001) | {"truth": "ring"},
            "whose patch follows from pressure and stiffness",
        ),
        (nuisance("rolling_radius", error=-0.5), "from -0.1 to 0.1"),
        (nuisance("rolling_radius", growth=-0.1), "from 0 to 0.1"),
        (nuisance("rolling_radius", at_speed_m_s=0.0), "from 1 to 120"),
        (
            nuisance("load_wander", share=0.01) | {"truth": "coupled_ring"},
            'allowed is a drive with truth = "beam" or "ring"',
        ),
        (nuisance("load_wander", share=0.01) | {"ramp": {}}, "[nuisances] with a [ramp]"),
        (channel(noise_correlation=1.0), "from 0 to 0.999"),
        (channel(hum=-1.0), "from 0 to"),
        (channel(hum_Hz=0.0), "from 0.1 to"),
        (channel(flicker="much"), "from 0 to"),
        (channel(lost_at_flanks=1.0), "from 0 to 0.9"),
    ],
)
def test_refused_with_what_is_allowed(more: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as caught:
        scenario_of(tables(**more), "drive.toml")
    text = str(caught.value)
    assert said in text
    assert "drive.toml" in text
    assert "allowed" in text


def test_file_with_everything_is_read(tmp_path: Any) -> None:
    """The same keys in TOML."""
    file = tmp_path / "drive.toml"
    file.write_text(
        "[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n"
        '[channels.s]\nkind = "fbg_strain"\nhum = 0.003\nlost_at_flanks = 0.3\n'
        "[nuisances.run_out]\namplitudes_microstrain = [3, 1.5]\nphases_deg = [-20, 40]\n"
        "[nuisances.rolling_radius]\nerror = -0.015\n",
        encoding="utf-8",
    )
    read = load_scenario(file)
    assert read.nuisances.run_out.amplitudes_microstrain == (3.0, 1.5)
    assert read.nuisances.rolling_radius.error == -0.015
    assert read.nuisances.load_wander.share == 0.0
    assert read.channels["s"].hum == 0.003
