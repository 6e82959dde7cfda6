"""Every column of every table, once.

Name, unit, type, meaning, and the difference that `check` accepts.

`TABLES` says which columns a table has and in which order. A column's tolerance is absolute +
relative x |value|: differences that another machine's BLAS or a rounding in text may bring, far
below any error bar. The register is longer than others: nobody looks for a column in two files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tirelog.vocabulary.observables import OBSERVABLES, SCALARS
from tirelog.vocabulary.tables import LOG_TABLES


@dataclass(frozen=True)
class TableColumn:
    """A column.

    kind         float, int, bool or text; tolerances apply to floats only
    positive_in  "drive" or "braking" if the column's sign tells the one from the other
    own          meanings in single tables, by the table's name, if they differ from `meaning`
    """

    name: str
    unit: str
    kind: str
    meaning: str
    absolute: float = 0.0
    relative: float = 1e-6
    positive_in: str = ""
    own: Mapping[str, str] = field(default_factory=dict)

    def meaning_in(self, table: str) -> str:
        """What the column is in this table, with its sign."""
        sign = f", positive in {self.positive_in}" if self.positive_in else ""
        return self.own.get(table, self.meaning) + sign


def _text(name: str, meaning: str) -> TableColumn:
    return TableColumn(name, "", "text", meaning)


def _integer(name: str, meaning: str) -> TableColumn:
    return TableColumn(name, "", "int", meaning)


#: tables of what a model says, not a log
_MODEL_TABLES = ("predict-all", "predict-numbers", "forces", "passage", "modes", "warm")

#: every column; a test holds that none is there twice
ALL = [
    _text("log", "the log's path as given ('-' for standard input)"),
    _text("channel", "the channel's name in the setup"),
    _integer(
        "revolution", "ordinal of the patch passage in the log, the same in all tables of a channel"
    ),
    TableColumn(
        "time_s",
        "s",
        "float",
        "time of the patch passage from the start of the log",
        1e-6,
        own={"passage": "time since the start of the drive"},
    ),
    TableColumn(
        "speed_m_s",
        "m/s",
        "float",
        "speed of the wheel centre at the passage",
        1e-5,
        own=dict.fromkeys(_MODEL_TABLES, "speed of the wheel centre"),
    ),
    _text("quality", "'ok', or words joined by ';' that say what is wrong inside the patch window"),
    # speed
    TableColumn(
        "period_s",
        "s",
        "float",
        "time from half a revolution before to half a revolution after the passage",
        1e-6,
    ),
    TableColumn("speed_se_m_s", "m/s", "float", "standard error of the speed", 1e-5, 1e-3),
    TableColumn(
        "acceleration_m_s2",
        "m/s^2",
        "float",
        "longitudinal acceleration at the passage",
        1e-3,
        1e-4,
        positive_in="drive",
        own=dict.fromkeys(_MODEL_TABLES, "longitudinal acceleration"),
    ),
    # slip
    TableColumn(
        "vehicle_speed_m_s", "m/s", "float", "the vehicle's mean speed over the turn", 1e-4, 1e-4
    ),
    TableColumn(
        "slip",
        "1",
        "float",
        "1 - omega R / V over the turn (P2 (14))",
        1e-6,
        positive_in="braking",
        own=dict.fromkeys(_MODEL_TABLES, "1 - omega R / V (P2 (14))"),
    ),
    TableColumn("slip_se", "1", "float", "standard error of the slip", 1e-6, 1e-3),
    TableColumn("slip_slope", "1", "float", "force over load per slip, at small slip", 1e-6, 1e-3),
    TableColumn("slip_slope_se", "1", "float", "its standard error", 1e-6, 1e-2),
    TableColumn("friction_by_slope", "1", "float", "f_s of P2 (17) by the slope", 1e-6, 1e-3),
    TableColumn("friction_by_slope_se", "1", "float", "its standard error", 1e-6, 1e-2),
    _integer("turns", "turns of the wheel that the line goes through"),
    TableColumn(
        "slip_delay_se",
        "1",
        "float",
        "the error's share for the delay of the vehicle's speed: in all rows together",
        1e-6,
        1e-2,
    ),
    # footprint
    TableColumn("length_m", "m", "float", "contact length, best estimate", 2e-6, 1e-4),
    TableColumn(
        "length_se_m",
        "m",
        "float",
        "standard error of the contact length from noise and timing",
        2e-6,
        1e-2,
    ),
    TableColumn(
        "length_form_se_m",
        "m",
        "float",
        "the error's share for the tire's own form: one sign in all rows of a log",
        2e-6,
        1e-1,
    ),
    TableColumn(
        "length_d2_m",
        "m",
        "float",
        "contact length by the extrema of the second derivative (P2)",
        2e-6,
        1e-4,
    ),
    TableColumn("length_d2_se_m", "m", "float", "its standard error from the noise", 2e-6, 1e-2),
    TableColumn(
        "length_d1_m",
        "m",
        "float",
        "contact length by the extrema of the first derivative (Morinaga)",
        2e-6,
        1e-4,
    ),
    TableColumn("length_d1_se_m", "m", "float", "its standard error from the noise", 2e-6, 1e-2),
    TableColumn("entry_time_s", "s", "float", "time at which the sensor enters the patch", 1e-6),
    TableColumn("exit_time_s", "s", "float", "time at which the sensor leaves the patch", 1e-6),
    TableColumn(
        "edge_asymmetry",
        "",
        "float",
        "(exit - entry) / (exit + entry) of the edges' second derivatives, above 0: exit sharper",
        1e-4,
        1e-4,
    ),
    TableColumn(
        "slip_onset_m",
        "m",
        "float",
        "abscissa where adhesion turns to slip, entry -L to exit +L",
        1e-5,
        1e-3,
    ),
    TableColumn("slip_onset_se_m", "m", "float", "its standard error", 1e-5, 1e-2),
    _text("slip_onset_reason", "why there is no slip onset; empty where there is one"),
    # grip
    TableColumn("adhesion_share_se", "1", "float", "its standard error", 1e-6, 1e-2),
    TableColumn(
        "brush_slip", "1", "float", "size of the slip that P2 (15) and (17) have it from", 1e-6
    ),
    TableColumn(
        "friction_used",
        "1",
        "float",
        "size of the longitudinal over the vertical force by the brush, P2 (13)",
        1e-6,
    ),
    TableColumn("friction_used_se", "1", "float", "its standard error", 1e-6, 1e-2),
    TableColumn(
        "grip_left", "1", "float", "1 less the friction used over the most that the brush has", 1e-6
    ),
    # strain-shift, wheel-angle
    TableColumn("wheel_speed_m_s", "m/s", "float", "speed of the wheel by its encoder", 1e-5),
    TableColumn("encoder_signal", "as recorded", "float", "the encoder's signal", 1e-9),
    TableColumn("turned_deg", "deg", "float", "wheel angle within the turn, 0 to 360", 1e-4),
    # dissipation
    TableColumn(
        "dissipation_factor_1_m",
        "1/m",
        "float",
        "integral of the squared strain gradient over a revolution (P1 29)",
        0.0,
        1e-4,
    ),
    TableColumn("dissipation_factor_se_1_m", "1/m", "float", "its standard error", 0.0, 1e-2),
    TableColumn(
        "specific_power_m3_s2",
        "m^3/s^2",
        "float",
        "dissipated power per viscosity (P1 28)",
        0.0,
        1e-4,
    ),
    TableColumn("steady", "", "bool", "the revolution lies in a stretch of constant speed"),
    TableColumn(
        "dissipation_factor_mean_1_m",
        "1/m",
        "float",
        "moving average of the factor within the steady stretch",
        0.0,
        1e-4,
    ),
    TableColumn(
        "specific_power_mean_m3_s2",
        "m^3/s^2",
        "float",
        "moving average of the specific power within the steady stretch",
        0.0,
        1e-4,
    ),
    TableColumn(
        "strip_power_W",
        "W",
        "float",
        "power in the strip under the grating with the setup's viscosity (P1 27)",
        0.0,
        1e-4,
    ),
    TableColumn(
        "strip_rolling_resistance_N",
        "N",
        "float",
        "the strip's power over the speed; no tire's rolling resistance",
        0.0,
        1e-4,
    ),
    TableColumn(
        "strip_rolling_resistance_coefficient",
        "",
        "float",
        "the strip's resistance over the tire's load",
        0.0,
        1e-4,
    ),
    # dissipation --fit
    _text("quantity", "what the row is of: the fitted column, or the part of the tire's form"),
    TableColumn("intercept", "of the quantity", "float", "value at speed 0", 0.0, 1e-3),
    TableColumn(
        "intercept_se",
        "of the quantity",
        "float",
        "its standard error from the scatter of the stretches' means",
        0.0,
        1e-2,
    ),
    TableColumn("slope", "of the quantity per m/s", "float", "change with speed", 0.0, 1e-3),
    TableColumn(
        "slope_se",
        "of the quantity per m/s",
        "float",
        "its standard error from the scatter of the stretches' means",
        0.0,
        1e-2,
    ),
    TableColumn(
        "slope_lower",
        "of the quantity per m/s",
        "float",
        "lower end of its 95 % interval (t quantile)",
        0.0,
        1e-2,
    ),
    TableColumn(
        "slope_upper",
        "of the quantity per m/s",
        "float",
        "upper end of its 95 % interval",
        0.0,
        1e-2,
    ),
    TableColumn(
        "scatter",
        "of the quantity",
        "float",
        "standard deviation of the revolutions about the line",
        0.0,
        1e-2,
    ),
    _integer("rows", "revolutions at constant speed"),
    _integer("stretches", "stretches of constant speed"),
    _integer(
        "points",
        "means that the line goes through: stretches, long slow changes of speed in pieces of 1 "
        "m/s",
    ),
    _integer("speeds", "speeds among them, 0.5 m/s or more apart"),
    _integer("degrees_of_freedom", "points less the line's two numbers"),
    TableColumn(
        "miss", "of the quantity", "float", "largest distance of a point from the line", 0.0, 1e-2
    ),
    TableColumn("miss_sigmas", "", "float", "and in standard errors of the points", 1e-2, 1e-2),
    TableColumn(
        "curvature",
        "of the quantity per m^2/s^2",
        "float",
        "coefficient of the squared speed in the parabola",
        0.0,
        1e-2,
    ),
    TableColumn(
        "curvature_se", "of the quantity per m^2/s^2", "float", "its standard error", 0.0, 1e-2
    ),
    _text("judgement", "what speaks against the line; empty if nothing does"),
    TableColumn("slowest_m_s", "m/s", "float", "range of the speeds: least", 1e-5),
    TableColumn("fastest_m_s", "m/s", "float", "range of the speeds: largest", 1e-5),
    # phase shift
    TableColumn(
        "entry_angle_deg",
        "deg",
        "float",
        "wheel angle of the entry front",
        1e-4,
        own={"strain-shift": "wheel angle at the entry edge of the patch by the strain"},
    ),
    TableColumn(
        "exit_angle_deg",
        "deg",
        "float",
        "wheel angle of the exit front",
        1e-4,
        own={"strain-shift": "wheel angle at the exit edge of the patch by the strain"},
    ),
    TableColumn(
        "patch_width_deg",
        "deg",
        "float",
        "angle between the fronts",
        1e-4,
        own={
            "strain-shift": "angle from entry to exit",
            "predict-numbers": OBSERVABLES["patch_width"].meaning,
        },
    ),
    TableColumn("patch_width_se_deg", "deg", "float", "its standard error", 1e-5, 1e-2),
    TableColumn(
        "phase_shift_deg",
        "deg",
        "float",
        "middle of the patch signal minus its value in the zero stretch",
        1e-4,
        positive_in="drive",
        own={
            "strain-shift": "middle of the patch minus its mean in the first good passages",
            "predict-numbers": OBSERVABLES["phase_shift"].meaning,
        },
    ),
    TableColumn("phase_shift_se_deg", "deg", "float", "its standard error", 1e-5, 1e-2),
    TableColumn(
        "patch_width_detrended_deg",
        "deg",
        "float",
        "patch width without its trend with speed",
        1e-4,
    ),
    TableColumn(
        "phase_shift_detrended_deg",
        "deg",
        "float",
        "phase shift without its trend with speed",
        1e-4,
        positive_in="drive",
    ),
    TableColumn(
        "phase_shift_corrected_deg",
        "deg",
        "float",
        "detrended phase shift without the cross-talk of load",
        1e-4,
        positive_in="drive",
    ),
    TableColumn(
        "vertical_force_N",
        "N",
        "float",
        "vertical force from the patch width by the calibration",
        0.1,
        1e-4,
        own={"grip": "vertical force from the contact length by the law length ~ load^exponent"},
    ),
    TableColumn(
        "vertical_force_se_N",
        "N",
        "float",
        "its standard error, by the regressor and the force map",
        0.1,
        1e-2,
        own={"grip": "its standard error, by length and load exponent"},
    ),
    TableColumn(
        "longitudinal_force_N",
        "N",
        "float",
        "longitudinal force from the phase shift by the calibration",
        0.1,
        1e-4,
        positive_in="drive",
        own={
            "grip": "friction used times vertical force, with the sign of an acceleration of 0.6 "
            "m/s^2 or more, else empty"
        },
    ),
    TableColumn(
        "longitudinal_force_se_N",
        "N",
        "float",
        "its standard error, by the regressor and the force map",
        0.1,
        1e-2,
        own={"grip": "its standard error, by length, load exponent and friction used"},
    ),
    # inflation
    TableColumn(
        "strain",
        "",
        "float",
        "strain at the sensor",
        1e-9,
        own={"inflation": "strain, mean over the row's stretch"},
    ),
    TableColumn("strain_se", "", "float", "its standard error", 1e-10, 1e-2),
    TableColumn(
        "inflation_pressure_Pa",
        "Pa",
        "float",
        "inflation pressure",
        1.0,
        own={"inflation": "inflation pressure, mean over the row's stretch"},
    ),
    _text("stretch", "whole, ramp or stop"),
    TableColumn("duration_s", "s", "float", "length of the row's stretch", 1e-3),
    TableColumn(
        "pressure_change_Pa",
        "Pa",
        "float",
        "inflation pressure at the end less that at the beginning of the stretch",
        1.0,
    ),
    TableColumn(
        "strain_change",
        "",
        "float",
        "strain at the end less that at the beginning of the stretch",
        1e-9,
    ),
    TableColumn(
        "strain_slope_1_Pa",
        "1/Pa",
        "float",
        "slope of the strain on the inflation pressure",
        0.0,
        1e-3,
    ),
    TableColumn("strain_slope_se_1_Pa", "1/Pa", "float", "its standard error", 0.0, 1e-2),
    TableColumn("strain_rate_1_s", "1/s", "float", "slope of the strain on time", 1e-10, 1e-3),
    TableColumn(
        "nonlinearity",
        "",
        "float",
        "largest deviation of the strain from its straight line, as a share of its range",
        1e-4,
        1e-2,
    ),
    TableColumn(
        "leak", "", "float", "strain lost at a stop, 0 if it is within the noise", 1e-9, 1e-2
    ),
    TableColumn("leak_se", "", "float", "standard error of the strain lost", 1e-9, 1e-2),
    # model predict
    TableColumn(
        "xi_m",
        "m",
        "float",
        "tread coordinate, entry edge at -L; of a form from its centre of pressure",
        1e-9,
    ),
    TableColumn("phi_deg", "deg", "float", "tread coordinate as an angle", 1e-7),
    TableColumn(
        "displacement_m", "m", "float", "radial displacement, inward positive", 1e-10, 1e-6
    ),
    TableColumn(
        "radial_acceleration_m_s2",
        "m/s^2",
        "float",
        "radial acceleration, outward positive",
        1e-4,
        1e-6,
    ),
    TableColumn(
        "contact_pressure_N_m", "N/m", "float", "contact pressure per length of tread", 1e-3, 1e-6
    ),
    TableColumn(
        "shear_traction_N_m",
        "N/m",
        "float",
        "traction of the road on the tread per length",
        1e-3,
        1e-6,
        positive_in="braking",
    ),
    # model predict --all, model forces
    TableColumn(
        "tangential_displacement_m",
        "m",
        "float",
        "displacement of a ring's belt along itself, in the direction of passing (v of P3)",
        1e-9,
        1e-6,
    ),
    TableColumn("strain_slope_1_m", "1/m", "float", "strain's derivative along the tread", 1e-7),
    TableColumn(
        "strain_curvature_1_m2", "1/m^2", "float", "strain's second derivative", 1e-5, 1e-5
    ),
    TableColumn("slip_angle_deg", "deg", "float", "slip angle of the wheel, P2's brush", 1e-6),
    TableColumn("camber_deg", "deg", "float", "camber of the wheel", 1e-6),
    TableColumn("patch_length_m", "m", "float", "length of the contact patch, 2 L", 1e-7),
    TableColumn("belt_deflection_m", "m", "float", "largest inward displacement of the belt", 1e-8),
    TableColumn(
        "hub_approach_m",
        "m",
        "float",
        "approach of the hub to a flat road by the yield of belt and tread",
        1e-8,
    ),
    TableColumn(
        "speed_ratio", "1", "float", "speed over a beam's critical speed, alpha of P1 (4)", 1e-6
    ),
    TableColumn(
        "damping_ratio",
        "1",
        "float",
        "share of the critical damping; of a beam sqrt(mu / k) omega_d, beta of P1 (4)",
        1e-8,
        1e-5,
    ),
    TableColumn(
        "hub_longitudinal_N",
        "N",
        "float",
        "force of a ring's sidewall on the hub along the road (F_x* of P3)",
        1e-3,
        positive_in="braking",
    ),
    TableColumn(
        "hub_vertical_N",
        "N",
        "float",
        "force of a ring's sidewall on the hub upwards, which carries the load (F_z* of P3)",
        1e-3,
    ),
    TableColumn(
        "road_lateral_N", "N", "float", "the brush's lateral force at slip angle and camber", 1e-3
    ),
    TableColumn(
        "aligning_moment_N_m", "N m", "float", "its moment, which turns the slip angle back", 1e-4
    ),
    TableColumn(
        "reference_longitudinal_N",
        "N",
        "float",
        "longitudinal force of the file that is compared",
        1e-3,
        positive_in="braking",
    ),
    TableColumn(
        "reference_lateral_N", "N", "float", "lateral force of the file that is compared", 1e-3
    ),
    TableColumn(
        "reference_aligning_moment_N_m",
        "N m",
        "float",
        "aligning moment of the file that is compared",
        1e-4,
    ),
    TableColumn(
        "adhesion_share",
        "1",
        "float",
        "share of the patch that adheres, (x_s + L) / 2L (P2 (15)): the grip that is left",
        1e-6,
    ),
    TableColumn(
        "pressure_centre_m",
        "m",
        "float",
        "where the load acts on the road against the hub, negative ahead: -moment / load (P1 3.2)",
        1e-8,
    ),
    TableColumn(
        "dissipated_power_W",
        "W",
        "float",
        "power that rolling takes: the moment times the angular speed",
        1e-6,
    ),
    TableColumn(
        "carcass_power_W", "W", "float", "the share of it that the losses of the carcass take", 1e-6
    ),
    TableColumn(
        "tread_power_W",
        "W",
        "float",
        "the rest: what a pressure that effects lean takes in tread or water; below 0 none can",
        1e-6,
    ),
    TableColumn(
        "sliding_power_W",
        "W",
        "float",
        "power of the brush's sliding, not of rolling",
        1e-6,
    ),
    TableColumn("rolling_resistance_N", "N", "float", "the dissipated power over the speed", 1e-6),
    TableColumn(
        "rolling_resistance_coefficient", "1", "float", "rolling resistance over the load", 1e-10
    ),
    TableColumn(
        "rolling_resistance_moment_N_m",
        "N m",
        "float",
        "moment of the road's pressure about the hub, turns the wheel back (P1 3.2)",
        1e-6,
    ),
    TableColumn(
        "bending_power_W",
        "W",
        "float",
        "viscous power in the strip under the grating in bending (P1 (25))",
        0.0,
        1e-5,
    ),
    TableColumn("contact_width_deg", "deg", "float", "angle of the patch itself", 1e-6),
    TableColumn("stretching_power_W", "W", "float", "the same in stretching (P1 (27))", 0.0, 1e-5),
    TableColumn(
        "dry_length_m", "m", "float", "length of the patch less what floats on water", 1e-6
    ),
    # model predict over a road
    TableColumn(
        "sensor_deg",
        "deg",
        "float",
        "the sensor's angle on the belt at the start, 0 under the wheel",
        1e-9,
    ),
    TableColumn("distance_m", "m", "float", "distance driven since the start", 1e-6),
    TableColumn("load_N", "N", "float", "load on the axle", 1e-3),
    TableColumn(
        "wheel_angle_deg",
        "deg",
        "float",
        "angle that the ring has turned since the start",
        1e-3,
        1e-6,
    ),
    TableColumn(
        "hub_displacement_m", "m", "float", "height of the hub above that at the start", 1e-7, 1e-3
    ),
    TableColumn(
        "road_vertical_N", "N", "float", "vertical force of the road on the tire, up", 1.0, 1e-3
    ),
    TableColumn(
        "road_longitudinal_N",
        "N",
        "float",
        "force of the road on the tire along it, backwards",
        1.0,
        1e-3,
    ),
    TableColumn(
        "spindle_vertical_N",
        "N",
        "float",
        "vertical force of the sidewall on the hub, up",
        1.0,
        1e-3,
    ),
    TableColumn(
        "spindle_longitudinal_N",
        "N",
        "float",
        "force of the sidewall on the hub along the road, backwards",
        1.0,
        1e-3,
    ),
    # model warm
    TableColumn(
        "temperature_K",
        "K",
        "float",
        "rise of the tire's mean temperature above the surroundings",
        1e-4,
    ),
    TableColumn(
        "measured_temperature_K",
        "K",
        "float",
        "rise of the log's temperature since its start",
        1e-4,
    ),
    # model modes
    _text("support", "air, or road: the standing patch under the model's load"),
    TableColumn(
        "frequency_Hz",
        "Hz",
        "float",
        "natural frequency that an observer beside the tire hears",
        1e-6,
        1e-6,
    ),
    _text(
        "shape", "rigid vertical, longitudinal or whirl, rotational, or n-lobe, by kinetic energy"
    ),
    _integer("lobes", "n of the shape: 0 rotational, 1 rigid"),
    _text("direction", "with or against the rotation for a travelling wave, standing else"),
    TableColumn("share", "", "float", "share of the kinetic energy in that n", 1e-4, 1e-3),
    # form
    *(
        TableColumn(name, unit, "float", meaning, 0.0, 1e-2)
        for name, unit, meaning in (
            ("contact_pressure_se_N_m", "N/m", "its standard error"),
            ("contact_pressure_formula_N_m", "N/m", "contact pressure of the model's formula"),
            ("wavelength_m", "m", "length of a wave along the tread"),
            ("stiffness_N_m2", "N/m^2", "static load per length over deflection, of that wave"),
            ("stiffness_se_N_m2", "N/m^2", "its standard error"),
            ("stiffness_formula_N_m2", "N/m^2", "stiffness of the model's formula"),
        )
    ),
]

COLUMNS: dict[str, TableColumn] = {column.name: column for column in ALL}

#: the columns of every table; those of a log are named in `tables`
TABLES: dict[str, tuple[str, ...]] = {
    **{table.name: table.columns for table in LOG_TABLES.values()},
    "dissipation-fit": (
        "log", "channel", "quantity", "intercept", "intercept_se", "slope", "slope_se",
        "slope_lower", "slope_upper", "scatter", "rows", "stretches", "points", "speeds",
        "degrees_of_freedom", "slowest_m_s", "fastest_m_s", "miss", "miss_sigmas", "curvature",
        "curvature_se", "judgement",
    ),
    "slip-fit": (
        "log", "channel", "turns", "slip_slope", "slip_slope_se", "friction_by_slope",
        "friction_by_slope_se",
    ),
    "predict": (
        "xi_m", "phi_deg", "displacement_m", "strain", "radial_acceleration_m_s2",
        "contact_pressure_N_m", "shear_traction_N_m",
    ),
    "predict-all": (
        "speed_m_s", "load_N", "inflation_pressure_Pa", "acceleration_m_s2", "slip", "xi_m",
        "phi_deg", "displacement_m", "tangential_displacement_m", "strain", "strain_slope_1_m",
        "strain_curvature_1_m2", "radial_acceleration_m_s2", "contact_pressure_N_m",
        "shear_traction_N_m",
    ),
    "forces": (
        "speed_m_s", "load_N", "inflation_pressure_Pa", "acceleration_m_s2", "slip",
        "slip_angle_deg", "camber_deg", "patch_length_m", "dry_length_m", "contact_width_deg",
        "patch_width_deg",
        "belt_deflection_m", "hub_approach_m", "speed_ratio", "damping_ratio", "hub_longitudinal_N",
        "hub_vertical_N", "road_longitudinal_N", "road_lateral_N", "aligning_moment_N_m",
        "adhesion_share", "pressure_centre_m", "dissipated_power_W", "carcass_power_W",
        "tread_power_W", "sliding_power_W", "rolling_resistance_N",
        "rolling_resistance_coefficient", "rolling_resistance_moment_N_m", "bending_power_W",
        "stretching_power_W", "strip_power_W", "reference_longitudinal_N", "reference_lateral_N",
        "reference_aligning_moment_N_m",
    ),
    "predict-numbers": (
        "speed_m_s", "load_N", "inflation_pressure_Pa", "acceleration_m_s2", "slip",
        *(OBSERVABLES[name].column for name in SCALARS),
    ),
    "passage": (
        "sensor_deg", "time_s", "distance_m", "speed_m_s", "load_N", "wheel_angle_deg",
        "hub_displacement_m", "road_vertical_N", "road_longitudinal_N", "spindle_vertical_N",
        "spindle_longitudinal_N", "strain", "radial_acceleration_m_s2",
    ),
    "form": (
        "quantity", "xi_m", "contact_pressure_N_m", "contact_pressure_se_N_m",
        "contact_pressure_formula_N_m", "wavelength_m", "stiffness_N_m2", "stiffness_se_N_m2",
        "stiffness_formula_N_m2", "quality",
    ),
    "warm": (
        "time_s", "temperature_K", "measured_temperature_K", "speed_m_s", "load_N",
        "inflation_pressure_Pa", "dissipated_power_W", "rolling_resistance_N",
    ),
    "modes": (
        "support", "speed_m_s", "frequency_Hz", "damping_ratio", "shape", "lobes", "direction",
        "share",
    ),
}  # fmt: skip

#: columns that stand in a table only if the setup or calibration gives what they need
OPTIONAL = {
    "strip_power_W", "strip_rolling_resistance_N", "strip_rolling_resistance_coefficient",
    "vertical_force_N", "vertical_force_se_N", "longitudinal_force_N", "longitudinal_force_se_N",
    "reference_longitudinal_N", "reference_lateral_N", "reference_aligning_moment_N_m",
}  # fmt: skip
