"""Faults: scenarios and motions that cannot be are refused, with what to do."""

import pytest

from tests.processes import python
from tirelog.cli import run
from tirelog.errors import UsageError
from tirelog.simulation import scenario_of, simulate, write_log

from .worlds import scenario, tables

GOOD = '[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n\n[channels.s]\nkind = "fbg_strain"\n'


def grating(**more):
    return {"channels": {"s": {"kind": "fbg_strain", **more}}}


def cruise(seconds):
    return {"manoeuvres": [{"duration_s": seconds, "speed_m_s": 12.0}]}


def nuisance(name, **values):
    return {"nuisances": {name: values}}


CLEAT = {"kind": "cleat", "position_m": 5.0, "height_m": 0.01, "length_m": 0.04}
#: a tire in motion
MOVING = {"truth": "coupled_ring", "grid_points": 512, "step_s": 5e-5}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"grid_points": 1001}, "even"),
        ({"manoeuvres": []}, "no manoeuvres"),
        ({"manoeuvres": [{"regime": "crusie"}]}, "nearest: cruise"),
        ({"channels": {}}, "no channels"),
        ({"channels": {"s": {}}}, "allowed are"),
        (grating(temperature_channel="t"), "fbg_temperature"),
        ({"tire": {"contact": "flat"}}, "flat_road"),
        ({"ramp": {"stops_s": [5.0, 5.5]}}, "overlap"),
        ({"ramp": {"begin_s": 3.0, "end_s": 2.0}}, "overlap"),
        ({"effects": [{"form": "other"}]}, "without a name"),
        ({"effects": [{"name": "ring_curvature"}]}, 'truth = "ring"'),
        ({"effects": [{"name": "wear", "form": "second"}]}, "exact, other"),
        ({"effects": [{"name": "splice", "form": "other"}]}, "allowed are exact"),
        ({"effects": [{"name": "wear", "amplitud": 1.0}]}, "nearest: amplitude"),
        ({"effects": [{"name": "wear", "amplitude": "big"}]}, "finite number"),
        ({"effects": [{"name": "wear"}, {"name": "wear"}]}, "planted twice"),
        ({"nuisances": {"runout": {}}}, "nearest: run_out"),
        (nuisance("run_out", amplitudes_microstrain=[1.0] * 4), "at most 3 numbers"),
        (nuisance("run_out", phases_deg=[10.0]), "1 phases_deg for 0 harmonics"),
        (nuisance("force_variation", shares=[0.01], phases_deg=[0.0, 0.0]), "one for each"),
        (
            nuisance("warming", stiffness_per_K=-0.02) | {"conditions": {"warm_up_K": 50.0}},
            "leaves 0 of it after warm_up_K = 50; allowed is 0.3 at least",
        ),
        (
            nuisance("warming", patch_length_per_K=-0.001) | {"truth": "ring"},
            "whose patch follows from pressure and stiffness",
        ),
        (
            nuisance("load_wander", share=0.01) | {"truth": "coupled_ring"},
            'allowed is a drive with truth = "beam" or "ring"',
        ),
        (nuisance("load_wander", share=0.01) | {"ramp": {}}, "[nuisances] with a [ramp]"),
        (MOVING | {"truth": "beam", "road": CLEAT}, 'truth = "coupled_ring"'),
        (MOVING | {"effects": [{"name": "water_film"}]}, "load_transfer, aero_load"),
        (MOVING | {"effects": [{"name": "sensor_lag", "form": "other"}]}, "as the catalogue has"),
        (MOVING | {"tire": {"contact": "parabola"}}, 'truth = "ring" or "beam"'),
        (MOVING | {"ramp": {}}, 'truth = "ring" or "beam"'),
        (MOVING | {"grid_points": 1002}, "multiples of 8"),
        (MOVING | {"tire": {"hub_mass_kg": 0.0}}, "hub_mass_kg = 0.0"),
        (MOVING | {"tire": {"slip_stiffness_N": 5e4}}, "bristles"),
        (grating(sampling_rate_Hz=1.0) | cruise(10_143.0), "too long to be simulated"),
        (grating(sampling_rate_Hz=1e4) | cruise(601.0), "too long to be simulated"),
    ],
)
def test_refused_with_advice(more, said):
    """What each key may hold is in the table of docs/scenario.md, and refused by the schema."""
    with pytest.raises(UsageError) as refusal:
        scenario_of(tables(**more), "case.toml")
    assert said in str(refusal.value)
    assert str(refusal.value).startswith("case.toml: ")
    assert refusal.value.message.count(";") >= 2


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (
            {"truth": "beam", "manoeuvres": [{"duration_s": 2.0, "speed_m_s": 40.0}]},
            "critical speed",
        ),
        ({"truth": "ring", "conditions": {"load_N": 60000.0}}, "the contact is wider"),
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
        (
            {
                "effects": [{"name": "load_transfer", "coefficient": 100.0}],
                "manoeuvres": [
                    {"duration_s": 1.0, "speed_m_s": 10.0},
                    {"duration_s": 0.5, "speed_m_s": 12.0},
                ],
            },
            "allowed are loads and obstacles",
        ),
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
def test_tires_that_cannot_roll_so(more, said):
    with pytest.raises(UsageError) as refusal:
        simulate(scenario(**(MOVING | more)))
    assert said in str(refusal.value)
    assert refusal.value.message.count(";") >= 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 0\n1 0\n1.001 0.01\n", "slope"),
        ("0 0\n1 0\n1 0.01\n", "whose distances grow"),
        ("0 0\n2 0.01\n1 0.01\n", "whose distances grow"),
        ("0 0\n1 up\n", "could not convert string to float: 'up'"),
        ("0 0\n1 nan\n", "not two points or more"),
        ("0 0 0\n1 1 1\n", "not two points or more"),
        ("0 0\n1 1 1\n", "cannot be read"),
        ("# nothing\n", "not two points or more"),
        ("0 0\n0.3 0.0\n0.4 0.1\n", "rises 0.1 m"),
    ],
)
def test_roads_from_files(text, said, tmp_path):
    (tmp_path / "road.txt").write_text(text, encoding="utf-8")
    scenario = scenario_of(
        tables(**MOVING, road={"kind": "profile", "file": "road.txt"}), str(tmp_path / "s.toml")
    )
    with pytest.raises(UsageError) as refusal:
        simulate(scenario)
    assert said in str(refusal.value)


def command(tmp_path, text, output, capsys):
    scenario = tmp_path / "s.toml"
    scenario.write_text(text, encoding="utf-8")
    status = run(["simulate", str(scenario), "-o", str(tmp_path / output)])
    return status, capsys.readouterr().err


def test_command_writes_log_truth_and_setup(tmp_path, capsys):
    status, said = command(tmp_path, GOOD, "log.csv", capsys)
    assert status == 0
    assert {p.name for p in tmp_path.iterdir()} == {
        "s.toml",
        "log.csv",
        "log.csv.truth.json",
        "log.toml",
    }
    assert "no effect" in said


@pytest.mark.parametrize(
    ("output", "why"),
    [
        ("log.dat", "suffix"),
        ("log", "suffix"),
        ("log.mcap.gz", "suffix"),
        ("missing/log.csv", "missing"),
        ("s.csv", "scenario"),  # its setup would be on the scenario itself
    ],
)
def test_command_refuses_where_nothing_can_be_written(tmp_path, output, why, capsys):
    status, said = command(tmp_path, GOOD, output, capsys)
    assert status == 2
    assert said.startswith("tirelog: error: ")
    assert why in said
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]
    assert (tmp_path / "s.toml").read_text(encoding="utf-8") == GOOD


def test_text_cannot_hold_two_rates(tmp_path):
    channels = {
        "s": {"kind": "fbg_strain"},
        "v": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0},
    }
    made = simulate(scenario(channels=channels))
    with pytest.raises(UsageError, match="one sampling rate"):
        write_log(made, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_while_hdf5_is_written(tmp_path):
    """HDF5 itself ends the process there; a limit on a file's size stands for the disk."""
    (tmp_path / "s.toml").write_text(GOOD, encoding="utf-8")
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000));"
        "from tirelog.cli import run; sys.exit(run(['simulate', 's.toml', '-o', 'o.h5']))"
    )
    # without a file of bytecode, which would be the first that is too large
    done = python(program, folder=tmp_path, status=2, PYTHONDONTWRITEBYTECODE="1")
    said = "tirelog: error: o.h5: cannot be written (File too large)"
    assert done.stderr.splitlines()[-1].startswith(said)
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]
