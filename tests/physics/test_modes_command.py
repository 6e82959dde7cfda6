"""Property: `tirelog model modes` from the outside."""

import pytest

from tests.physics.commands import rows, status

MODES = "model modes ring.toml"


@pytest.fixture(autouse=True)
def ring(here):
    status("model new --carcass ring --set load_N=1000 --set radius_m=0.3 -o ring.toml --quiet")


def test_in_the_air_and_on_the_road(capsys):
    table = rows(capsys, MODES)
    assert list(table[0]) == [
        "support", "speed_m_s", "frequency_Hz", "damping_ratio", "shape", "lobes", "direction",
        "share",
    ]  # fmt: skip
    air = [row for row in table if row["support"] == "air"]
    road = [row for row in table if row["support"] == "road"]
    assert {"rigid vertical", "rigid longitudinal", "rotational", "2-lobe", "3-lobe"} <= {
        row["shape"] for row in air
    }
    assert road[0]["shape"] == "rigid vertical"
    assert road[0]["frequency_Hz"] < air[0]["frequency_Hz"]
    assert all(row["frequency_Hz"] <= 300.0 for row in table)
    assert {row["direction"] for row in table} == {"standing"}


def test_speed_splits_and_load_stiffens(capsys):
    turning = [
        r
        for r in rows(capsys, MODES, "--speed", "20")
        if r["support"] == "air" and r["shape"] == "2-lobe"
    ]
    assert [r["direction"] for r in turning] == ["against", "with"]
    light, heavy = (rows(capsys, MODES, "--load", load) for load in ("500", "4000"))
    first = [
        next(r["frequency_Hz"] for r in table if r["support"] == "road") for table in (light, heavy)
    ]
    assert first[0] < first[1]


def test_no_mode_so_low_is_a_table_without_rows(capsys):
    capsys.readouterr()
    assert status(MODES, "--to-frequency", "1") == 0
    assert capsys.readouterr().out.strip().count("\n") == 0


def test_a_ring_without_tread_has_the_modes_of_the_air(capsys):
    status("model new --carcass ring --contact prescribed -o bare.toml --quiet")
    assert {row["support"] for row in rows(capsys, "model modes bare.toml")} == {"air"}


def test_shapes_of_modes_are_drawn(here):
    few = ["--to-frequency", "60", "-o", "modes.csv", "--quiet"]
    assert status(MODES, "--plot", "modes.svg", *few) == 0
    assert (here / "modes.svg").read_bytes().startswith(b"<?xml")
