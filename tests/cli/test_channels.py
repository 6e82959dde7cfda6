"""Property: `--channel` on the tables gives those rows, as they are without it, and no others."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.cli.conftest import RATE_HZ, pulse_rows

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture
def two_gratings(folder):
    """The log with its grating a second time."""
    rows = [f"{row},{row.split(',')[1]}" for row in pulse_rows()]
    (folder / "log.csv").write_text("time_s,CH1,CH2,CH3\n" + "\n".join(rows) + "\n")
    setup = (folder / "log.toml").read_text()
    (folder / "log.toml").write_text(
        setup.replace(
            "[log]",
            '[channels.strain_2]\nkind = "fbg_strain"\nsource = "CH3"\nunit = "nm"\n'
            'reference_wavelength_nm = 1550.0\ntemperature_channel = "temp_1"\n[log]',
        )
    )
    assert RATE_HZ == 2500.0
    return folder


@pytest.mark.parametrize("name", ["speed", "footprint", "dissipation"])
def test_one_of_two_channels(name, two_gratings, tirelog):
    assert tirelog(name, "log.csv", "-o", "all.csv").status == 0
    assert tirelog(name, "log.csv", "-o", "one.csv", "--channel", "strain_2").status == 0
    whole, one = pd.read_csv("all.csv"), pd.read_csv("one.csv")
    assert set(whole.channel) == {"strain_1", "strain_2"}
    own = whole[whole.channel == "strain_2"].reset_index(drop=True)
    assert list(one.columns) == list(whole.columns)
    assert set(one.channel) == {"strain_2"}
    for column in one.columns:
        if one[column].dtype.kind == "f":
            np.testing.assert_allclose(one[column], own[column], rtol=1e-6, err_msg=column)
        else:
            assert (one[column] == own[column]).all()


def test_all_tables_of_one_channel(two_gratings, tirelog):
    assert tirelog("tables", "log.csv", "-o", "made", "--channel", "strain_1").status == 0
    for table in ("speed", "footprint", "dissipation"):
        assert set(pd.read_csv(f"made/{table}.csv").channel) == {"strain_1"}


def test_a_channel_that_is_not_there_is_refused_before_anything_is_written(two_gratings, tirelog):
    tirelog("speed", "log.csv", "-o", "one.csv", "--channel", "strain_3").refused(
        "strain_1, strain_2"
    )
    assert not (two_gratings / "one.csv").exists()
    other_kind = tirelog("speed", "log.csv", "--channel", "temp_1").ended(2)
    assert not other_kind.out


def test_the_rows_of_a_phase_shift_are_of_the_accelerometer(tirelog):
    chosen = tirelog("phase-shift", SAMPLES / "encoder.h5", "--channel", "acceleration").ended(0)
    assert chosen.out == tirelog("phase-shift", SAMPLES / "encoder.h5").out
    assert tirelog("phase-shift", SAMPLES / "encoder.h5", "--channel", "encoder").status == 2
