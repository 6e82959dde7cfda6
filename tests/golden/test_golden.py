"""Golden: the tables of the sample logs, by each column's own tolerance."""

from pathlib import Path

import pytest

from tirelog.cli import run

GOLDEN = Path(__file__).parent
SAMPLES = GOLDEN.parents[1] / "sample_data"
TABLES = {
    "speed": ["speed", "drive.csv.gz"],
    "speed_mcap": ["speed", "drive_messages.mcap"],
    "speed_encoder": ["speed", "encoder.h5"],
    "footprint": ["footprint", "drive.csv.gz"],
    "dissipation": ["dissipation", "drive.csv.gz"],
    "phase_shift": ["phase-shift", "encoder.h5"],
    "inflation": ["inflation", "inflation.csv.gz"],
}


@pytest.mark.parametrize("name", TABLES)
def test_the_sample_logs_tables_have_not_moved(name, tmp_path, monkeypatch, capfd):
    assert (GOLDEN / f"{name}.csv").is_file()
    monkeypatch.chdir(SAMPLES)
    assert run([*TABLES[name], "-o", str(tmp_path / "now.csv"), "--quiet"]) == 0
    status = run(["check", str(tmp_path / "now.csv"), "--against", str(GOLDEN / f"{name}.csv")])
    assert status == 0, capfd.readouterr().out[:2000]


def test_text_and_mcap_of_one_drive_give_the_same_speeds():
    import pandas as pd

    text, messages = (
        pd.read_csv(GOLDEN / f"{name}.csv").drop(columns="log") for name in ("speed", "speed_mcap")
    )
    pd.testing.assert_frame_equal(text, messages, check_exact=False, rtol=1e-6, atol=1e-6)
