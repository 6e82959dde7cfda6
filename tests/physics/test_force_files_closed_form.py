"""Closed form: Magic Formulas at their limits, and TYDEX channels in other units."""

import numpy as np
import pytest

from tirelog.api.models import read_forces

LOAD = 4000.0
PURE = {
    "FNOMIN": LOAD, "PCX1": 1.6, "PDX1": 1.2, "PKX1": 21.0,
    "PCY1": 1.3, "PDY1": 0.9, "PKY1": -16.0, "PKY2": 2.0,
}  # fmt: skip


def formula(tmp_path, **more):
    path = tmp_path / "tire.tir"
    lines = [f"{name} = {value} $ a remark" for name, value in {**PURE, **more}.items()]
    path.write_text("\n".join(["[MDI_HEADER]", "LENGTH = 'meter'", *lines]))
    return read_forces(path)


def under(n=1, **given):
    """Conditions of n rows at the nominal load, straight ahead."""
    names = ("slip", "slip_angle_deg", "camber_deg", "inflation_pressure_Pa")
    return {name: np.full(n, LOAD if name == "load_N" else 0.0) for name in ("load_N", *names)} | {
        name: np.broadcast_to(np.asarray(value, float), n) for name, value in given.items()
    }


def test_slopes_and_peaks_are_those_of_the_coefficients(tmp_path):
    tire, small = formula(tmp_path), 1e-6
    along = tire.forces(under(slip=small))["road_longitudinal_N"][0]
    assert along == pytest.approx(21.0 * LOAD * small, rel=1e-5)  # K_xk of (4.E15)
    across = tire.forces(under(slip_angle_deg=np.degrees(small)))["road_lateral_N"][0]
    stiffness = 16.0 * LOAD * np.sin(2.0 * np.arctan(0.5))  # (4.E25), its sign that of ISO
    assert across == pytest.approx(stiffness * small, rel=1e-5)
    slips = np.linspace(-1.0, 1.0, 20001)
    braked = tire.forces(under(slips.size, slip=slips))["road_longitudinal_N"]
    assert braked.max() == pytest.approx(1.2 * LOAD, rel=1e-6)
    np.testing.assert_allclose(braked, -braked[::-1], rtol=0, atol=1e-6)


def test_a_wheel_that_slides_has_the_shape_factor_s_share_of_the_peak(tmp_path):
    locked = formula(tmp_path, PKX1=1e7).forces(under(slip=1.0))["road_longitudinal_N"][0]
    assert locked == pytest.approx(1.2 * LOAD * np.sin(1.6 * np.pi / 2.0), rel=1e-5)


def test_load_and_pressure_change_friction_and_stiffness(tmp_path):
    tire = formula(tmp_path, PDX2=-0.1, PPX3=-0.2, NOMPRES=2e5, PPX1=0.5, PKX2=2.0, PKX3=-0.3)
    slips = np.linspace(0.0, 1.0, 20001)
    given = under(slips.size, slip=slips, load_N=5000.0, inflation_pressure_Pa=2.2e5)
    peak = tire.forces(given)["road_longitudinal_N"].max()
    assert peak == pytest.approx((1.2 - 0.1 * 0.25) * (1.0 - 0.2 * 0.1) * 5000.0, rel=1e-6)
    stiff = tire.forces(under(slip=1e-6, load_N=5000.0, inflation_pressure_Pa=2.2e5))
    wanted = (21.0 + 0.5) * np.exp(-0.075) * (1.0 + 0.5 * 0.1) * 5000.0 * 1e-6
    assert stiff["road_longitudinal_N"][0] == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize(
    ("more", "thrust"),
    [
        ({"PHY3": 0.05, "PVY3": 0.1}, lambda k: -0.05 * k + 0.1 * LOAD),
        ({"PKY6": -0.7, "PVY3": 0.1}, lambda _: -0.7 * LOAD),  # (4.E30), whatever PVY3 is
    ],
)
def test_camber_thrust_of_versions_5_and_6(tmp_path, more, thrust):
    small, stiffness = 1e-5, 16.0 * LOAD * np.sin(2.0 * np.arctan(0.5))
    found = formula(tmp_path, **more).forces(under(camber_deg=np.degrees(small)))
    assert -found["road_lateral_N"][0] == pytest.approx(thrust(stiffness) * small, rel=1e-3)


def test_combined_slip_weighs_each_force_by_the_other_slip(tmp_path):
    more = {"RBX1": 12.0, "RCX1": 1.1, "RBY1": 9.0, "RCY1": 1.05}
    pure, tire = formula(tmp_path), formula(tmp_path, **more)
    both = under(slip=0.1, slip_angle_deg=4.0)
    share = np.cos(1.1 * np.arctan(12.0 * np.radians(4.0)))
    alone = pure.forces(both)
    found = tire.forces(both)
    assert found["road_longitudinal_N"] == pytest.approx(alone["road_longitudinal_N"] * share)
    share = np.cos(1.05 * np.arctan(9.0 * -0.1))
    assert found["road_lateral_N"] == pytest.approx(alone["road_lateral_N"] * share)
    alone, found = (of.forces(under(slip=0.1))["road_longitudinal_N"] for of in (pure, tire))
    assert found == pytest.approx(alone)


TYDEX = """\
**HEADER
**CONSTANTS
LONGVEL   speed                         km/h      72
INFLPRES  pressure                      bar       2.2
**MEASURCHANNELS
! name    description                   unit      factor
FZW       wheel load                    kN        1         0         0
LONGSLIP  slip of the wheel             %         1
SLIPANGL  slip angle                    rad       0.001     0         0
RUNTIME   time                          s         1         0         0
FX        force forward                 N
**MEASURDATA
4.0   -10   50   0.0   -3000
4.1    0    0    0.1   12.5
**END
"""


def test_tydex_channels_come_in_si_with_the_brush_s_signs(tmp_path):
    path = tmp_path / "rig.tdx"
    path.write_text(TYDEX)
    found = read_forces(path)
    wanted = {
        "speed_m_s": [20.0, 20.0],
        "inflation_pressure_Pa": [2.2e5, 2.2e5],
        "load_N": [4000.0, 4100.0],
        "slip": [0.1, 0.0],
        "slip_angle_deg": np.degrees([0.05, 0.0]),
        "road_longitudinal_N": [3000.0, -12.5],
    }
    assert set(found) == set(wanted)
    for name, values in wanted.items():
        assert found[name] == pytest.approx(values, rel=1e-12), name
    path.write_text(TYDEX.replace("**MEASURCHANNELS", "INCLANGL a deg 2\n**MEASURCHANNELS"))
    assert read_forces(path)["camber_deg"] == pytest.approx([2.0, 2.0])
