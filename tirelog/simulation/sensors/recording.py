"""The setup of a simulated log, and the log as a Recording in memory.

The readers' text is skipped.

Simulated --setup_text--> TOML --parse_setup--> Setup;  channels in SI on their stamps --> Recording
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import LogConditions, parse_setup
from tirelog.simulation.scenario.schema import SOURCE_UNITS, Scenario, Sensor, TrueConditions
from tirelog.simulation.sensors.sampling import PER_SI
from tirelog.simulation.simulate import Simulated
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS, STRAIN_KINDS

#: keys of a channel's setup that are the simulator's own, by kind
_CHANNEL_KEYS = {
    "fbg_strain": (
        "reference_wavelength_nm",
        "strain_gain",
        "thermal_expansion_1_K",
        "temperature_channel",
        "surface",
    ),
    "fbg_temperature": ("reference_wavelength_nm", "temperature_sensitivity_nm_K"),
    "strain": ("surface",),
    "wheel_encoder": ("steps",),
}
_TIRE_KEYS = (
    "name",
    "unloaded_radius_m",
    "rolling_radius_m",
    "section_height_m",
    "width_m",
    "section_area_m2",
    "viscosity_Pa_s",
    "static_footprint_length_m",
)
_ROAD_KEYS = (
    "kind",
    "height_m",
    "length_m",
    "ramp_m",
    "amplitude_m",
    "wavelength_m",
    "file",
    "spacing_m",
)
#: what a setup says of the conditions, of those that the simulator knows
_CONDITION_KEYS = tuple(
    f.name for f in fields(TrueConditions) if f.name in {f.name for f in fields(LogConditions)}
)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def setup_text(scenario: Scenario, sources: dict[str, str], time: str | None = None) -> str:
    """The setup file of a scenario's log: what a test engineer knows of it.

    `sources` name -> source in the file.
    """
    lines = ["[tire]"]
    lines += [
        f"{key} = {_toml(value)}"
        for key in _TIRE_KEYS
        if (value := getattr(scenario.tire, key)) is not None
    ]
    lines += ["", "[conditions]"]
    lines += [f"{key} = {_toml(getattr(scenario.conditions, key))}" for key in _CONDITION_KEYS]
    if scenario.road.kind != "flat":
        # where the obstacle stands is for the log to say
        road = {key: getattr(scenario.road, key) for key in _ROAD_KEYS}
        lines += [
            "",
            "[road]",
            *(f"{key} = {_toml(value)}" for key, value in road.items() if value is not None),
        ]
    several = sum(sensor.kind in STRAIN_KINDS for sensor in scenario.channels.values()) > 1
    for name, sensor in scenario.channels.items():
        lines += ["", f"[channels.{name}]", *_channel_lines(sensor, sources[name])]
        if several and sensor.kind in STRAIN_KINDS:  # of one nobody asks where it stands
            lines.append(f"angle_deg = {sensor.angle_deg!r}")
    if time is not None:
        rate = next(iter(scenario.channels.values())).sampling_rate_Hz
        lines += ["", "[log]", f"sampling_rate_Hz = {rate!r}", f'time = "{time}"']
    return "\n".join(lines) + "\n"


def _channel_lines(sensor: Sensor, source: str) -> list[str]:
    lines = [
        f'kind = "{sensor.kind}"',
        f'source = "{source}"',
        f'unit = "{SOURCE_UNITS[sensor.kind]}"',
    ]
    for key in _CHANNEL_KEYS.get(sensor.kind, ()):
        value = getattr(sensor, key)
        if value is not None:
            lines.append(f"{key} = {_toml(value)}")
    if sensor.gauge_length_m:
        lines.append(f"gauge_length_m = {sensor.gauge_length_m!r}")
    return lines


def to_recording(simulated: Simulated, log: str = "simulated") -> Recording:
    """The log as readers would give it.

    Channels in SI, NaN if lost, on uniform axes; nothing quantised by text.
    """
    scenario = simulated.scenario
    setup = parse_setup(setup_text(scenario, {name: name for name in scenario.channels}), log)
    channels = {}
    for name, sensor in scenario.channels.items():
        values = _in_si(simulated, name)
        stamp = simulated.stamp_s[name]
        axis = TimeAxis.uniform(
            values.size, sensor.sampling_rate_Hz, float(stamp[0]) if stamp.size else 0.0
        )
        own = setup.channels[name]
        settings = {
            key: getattr(own, key)
            for key in ("steps", "gauge_length_m")
            if getattr(own, key) is not None
        }
        channels[name] = Channel.of_array(
            name,
            sensor.kind,
            values,
            axis,
            unit=KINDS[sensor.kind].unit,
            surface=sensor.surface,
            settings=settings,
        )
    return Recording(log, channels, setup, {"simulated_seed": scenario.seed})


def _in_si(simulated: Simulated, name: str) -> FloatArray:
    """One channel's values in SI.

    Gratings by P1 (1), with the twin's temperature if the channel names one.
    """
    sensor, raw = simulated.scenario.channels[name], simulated.channels[name]
    if sensor.kind == "fbg_temperature":
        return (raw - sensor.reference_wavelength_nm) / sensor.temperature_sensitivity_nm_K
    if sensor.kind == "fbg_strain":
        strain = sensor.strain_gain * (raw / sensor.reference_wavelength_nm - 1.0)
        if sensor.temperature_channel is not None:
            warm = _in_si(simulated, sensor.temperature_channel)
            stamps = simulated.stamp_s
            known = np.isfinite(warm)
            at = np.interp(stamps[name], stamps[sensor.temperature_channel][known], warm[known])
            strain = strain - sensor.thermal_expansion_1_K * at
        return strain
    if sensor.kind == "temperature":
        return raw + 273.15
    return raw / PER_SI.get(sensor.kind, 1.0)
