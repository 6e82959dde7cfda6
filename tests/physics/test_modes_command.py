"""Property: `tirelog model modes` from the outside."""

import re

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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--speed", "500"), "beyond the critical one"),
        (("--hub-mass", "0"), "m_h = 0"),
        (("--load", "-3"), "does not press"),
        (("--to-frequency", "0"), "above zero"),
    ],
)
def test_what_cannot_ring(capsys, arguments, said):
    assert status(MODES, *arguments) == 2
    assert re.search(r"tirelog: error: .*" + said + ".*; ", capsys.readouterr().err)


def test_a_beam_has_none_and_a_ring_without_tread_only_the_air(capsys):
    status("model new -o beam.toml --quiet")
    assert status("model modes beam.toml") == 2
    assert "a beam has no natural modes" in capsys.readouterr().err
    status("model new --carcass ring --contact prescribed -o bare.toml --quiet")
    assert {row["support"] for row in rows(capsys, "model modes bare.toml")} == {"air"}
    assert status("model modes bare.toml --load 1000") == 2


def test_shapes_of_modes_are_drawn(here):
    few = ["--to-frequency", "60", "-o", "modes.csv", "--quiet"]
    assert status(MODES, "--plot", "modes.svg", *few) == 0
    assert (here / "modes.svg").read_bytes().startswith(b"<?xml")
