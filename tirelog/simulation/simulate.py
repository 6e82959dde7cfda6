"""A scenario becomes a log with known truth, in memory.

Scenario --seed--> drive, fluctuations of the load --> World
    --sampling--> Simulated (raw channels in the file's units, truth) --> Recording or a file

As files it is the log itself by suffix, LOG.truth.json and the setup beside it:

.csv .txt (also .gz): preamble, header, a row per sample, blank if a peak was lost. .mcap: JSON,
one sample per message, one topic per sampling rate. .h5 .hdf5: one dataset per channel with its
rate; counts with scale if the instrument has digits. Files appear whole or not at all.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.recording import Recording, TimeAxis
from tirelog.data.setup import LogConditions, parse_setup
from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import SOURCE_UNITS, Scenario, TrueConditions
from tirelog.simulation.sensors.sampling import (
    flanks,
    in_source_units,
    moments_of,
    pitch_tables,
    riding_values,
    spoiled,
    steady_truth,
    vehicle_values,
)
from tirelog.simulation.steady.waveforms import World, drive_of, roughness_of, wander_of
from tirelog.storage.schema import Record
from tirelog.storage.whole import all_or_none, whole_file
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import STRAIN_KINDS, WAVELENGTH_KINDS


@dataclass(frozen=True)
class Simulated:
    """A simulated log.

    `channels` raw values (n,) in the file's unit, NaN if lost; `stamp_s` (n,) their stamps [s];
    `world` the truth itself, to be asked for any instant; `known` gives the content of its file.
    """

    scenario: Scenario
    channels: Mapping[str, FloatArray]
    stamp_s: Mapping[str, FloatArray]
    world: World
    known: Callable[[], dict[str, Any]]

    @cached_property
    def truth(self) -> dict[str, Any]:
        """The log's truth, ready for JSON."""
        return self.known()


def simulate(scenario: Scenario) -> Simulated:
    """The log of a scenario.

    The same scenario (with its seed) gives the same numbers. UsageError if the physics refuses
    it.
    """
    streams = [
        np.random.default_rng(s)
        for s in np.random.SeedSequence(scenario.seed).spawn(4 + len(scenario.channels))
    ]
    # the tire's own rolling radius at rest, not the setup's
    radius = scenario.tire.rolling_radius_m * (1.0 + scenario.nuisances.rolling_radius.error)
    true = replace(scenario, tire=replace(scenario.tire, rolling_radius_m=radius))
    drive = drive_of(true, streams[0])
    length = float(drive.distance_at(drive.time_s[-1]))
    roughness = roughness_of(true, length, streams[1])
    stamps, moments = moments_of(true)
    if scenario.truth == "coupled_ring":
        from tirelog.simulation.rolling.world import (
            RolledWorld,  # brings the compiler
            truth_of_rolled,
        )

        world: World = (rolled := RolledWorld(true, drive, roughness))
        tables, clean = pitch_tables(world), rolled.values(moments)
        known = partial(truth_of_rolled, rolled, tables)
    else:
        world = World(true, drive, roughness, wander_of(true, streams[-1]))
        tables, clean = pitch_tables(world), riding_values(world, moments)
        known = partial(steady_truth, world, tables)
    channels = {}
    for (name, sensor), random in zip(true.channels.items(), streams[3:-1], strict=True):
        time, values = moments[name], clean.get(name)
        if values is None:
            values = vehicle_values(world, sensor, time, tables.get(name))
        told = in_source_units(world, sensor, time, values)
        if sensor.road_noise:  # an acceleration of the road's height, that is passed at v
            share = (world.drive.speed_at(time) / 20.0) ** 2
            told = told + sensor.road_noise * share * random.standard_normal(time.size)
        channels[name] = spoiled(sensor, told, flanks(world, sensor, time, told), random)
    return Simulated(scenario, channels, stamps, world, known)


# ---- The setup of a simulated log, and the log as a Recording in memory.
#
# The readers' text is skipped.
#
# Simulated --setup_text--> TOML --parse_setup--> Setup;  channels in SI on their stamps -->
# Recording


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


def setup_text(scenario: Scenario, sources: dict[str, str], time: str | None = None) -> str:
    """The setup file of a scenario's log, with a test engineer's knowledge.

    `sources` name -> source in the file.
    """
    lines = ["[tire]"]
    lines += [
        f"{key} = {json.dumps(value)}"
        for key in _TIRE_KEYS
        if (value := getattr(scenario.tire, key)) is not None
    ]
    lines += ["", "[conditions]"]
    lines += [f"{key} = {json.dumps(getattr(scenario.conditions, key))}" for key in _CONDITION_KEYS]
    if scenario.road.kind != "flat":
        # the place of the obstacle is for the log to show
        road = {key: getattr(scenario.road, key) for key in _ROAD_KEYS}
        lines += [
            "",
            "[road]",
            *(f"{key} = {json.dumps(value)}" for key, value in road.items() if value is not None),
        ]
    several = sum(sensor.kind in STRAIN_KINDS for sensor in scenario.channels.values()) > 1
    for name, sensor in scenario.channels.items():
        lines += ["", f"[channels.{name}]", f'kind = "{sensor.kind}"']
        lines += [f'source = "{sources[name]}"', f'unit = "{SOURCE_UNITS[sensor.kind]}"']
        known = {key: getattr(sensor, key) for key in _CHANNEL_KEYS.get(sensor.kind, ())}
        known |= {"gauge_length_m": sensor.gauge_length_m or None}
        known |= {"lateral_m": sensor.lateral_m or None}
        lines += [
            f"{key} = {json.dumps(value)}" for key, value in known.items() if value is not None
        ]
        if several and sensor.kind in STRAIN_KINDS:  # of one nobody asks where it is
            lines.append(f"angle_deg = {sensor.angle_deg!r}")
    if time is not None:
        rate = next(iter(scenario.channels.values())).sampling_rate_Hz
        lines += ["", "[log]", f"sampling_rate_Hz = {rate!r}", f'time = "{time}"']
    return "\n".join(lines) + "\n"


def to_recording(simulated: Simulated, log: str = "simulated") -> Recording:
    """The log as a recording, without the rounding of a text file.

    Channels in SI, NaN if lost, on uniform axes.
    """
    from tirelog.runs.store import recording_of  # brings HDF5
    from tirelog.runs.temporary import Run, Stored

    scenario, axes, channels = simulated.scenario, {}, {}
    setup = parse_setup(setup_text(scenario, {name: name for name in scenario.channels}), log)
    for name, known in setup.channels.items():
        raw, stamp = simulated.channels[name], simulated.stamp_s[name]
        rate, start = scenario.channels[name].sampling_rate_Hz, stamp[0] if stamp.size else 0.0
        axes[name] = TimeAxis.uniform(raw.size, rate, float(start))
        channels[name] = Stored(
            name,
            known.kind,
            known.source_unit,
            raw.size,
            raw.dtype,
            -1,
            partial(_part, raw),
            (),
        )
    about = {"simulated_seed": scenario.seed, "losses": []}
    return recording_of(Run(setup, axes, channels, about), log)


def _part(raw: FloatArray, start: int, stop: int, losses: list[str]) -> FloatArray:
    return raw[start:stop]


SUFFIXES = (".csv", ".txt", ".mcap", ".h5", ".hdf5")


def suffix_of(path: Path) -> str:
    """The suffix that decides the format (without .gz).  UsageError if none does."""
    suffix = Path(path.stem).suffix if path.suffix == ".gz" else path.suffix
    if suffix not in SUFFIXES or (path.suffix == ".gz" and suffix not in (".csv", ".txt")):
        allowed = ", ".join(SUFFIXES)
        raise UsageError(
            "the suffix decides the format",
            allowed=f"allowed are {allowed} and .csv.gz",
            do="give -o another name",
            file=path,
        )
    return suffix


def setup_of(path: Path) -> Path:
    """The path of a log's setup: the log's name with the suffix .toml."""
    return (path.with_suffix("") if path.suffix == ".gz" else path).with_suffix(".toml")


def truth_of(path: Path) -> Path:
    """The path of a log's truth: the log's name with .truth.json behind it."""
    return path.with_name(path.name + ".truth.json")


def write_log(simulated: Simulated, path: Path | str) -> list[Path]:
    """Write the log, its truth and its setup.  The files written, the log first."""
    path = Path(path)
    suffix = suffix_of(path)
    write = {".mcap": _write_mcap, ".h5": _write_hdf5, ".hdf5": _write_hdf5}.get(
        suffix, _write_text
    )
    truth, beside = truth_of(path), setup_of(path)
    with all_or_none():
        with whole_file(path) as part:
            setup = write(simulated, part, path.suffix == ".gz")
        with whole_file(truth) as part:
            part.write_text(json.dumps(simulated.truth, indent=1), encoding="utf-8")
        with whole_file(beside) as part:
            part.write_text(setup, encoding="utf-8")
    return [path, truth, beside]


def _sources(simulated: Simulated) -> dict[str, str]:
    return {name: s.source or name for name, s in simulated.scenario.channels.items()}


def _digits(sensor: Record) -> int:
    """Digits behind the point in the file's unit; gratings are written to 0.01 pm."""
    if sensor.quantisation:
        power = np.log10(sensor.quantisation)
        return max(0, int(np.ceil(-power - 1e-9)) + int(power % 1 != 0))
    return 5 if sensor.kind in WAVELENGTH_KINDS else 6


def _write_text(simulated: Simulated, path: Path, zipped: bool) -> str:
    """Comma-separated with a short preamble; every channel at one rate."""
    import pandas as pd

    scenario = simulated.scenario
    rates = {sensor.sampling_rate_Hz for sensor in scenario.channels.values()}
    if len(rates) > 1:
        raise UsageError(
            "text holds one sampling rate",
            allowed="allowed are .mcap and .h5 for several",
            do="give -o another suffix",
        )
    sources = _sources(simulated)
    stamp = next(iter(simulated.stamp_s.values()))
    step = 1.0 / next(iter(rates))
    # digits behind the point that hold a sample's step to the last, at most nine
    digits = next((d for d in range(1, 9) if abs(round(step, d) - step) < 1e-9 * step), 9)
    columns = {"time_s": pd.Series(stamp).map(f"{{:.{digits}f}}".format)}
    for name, sensor in scenario.channels.items():
        shape = f"{{:.{_digits(sensor)}f}}".format
        columns[sources[name]] = (
            pd.Series(simulated.channels[name]).map(shape, na_action="ignore").fillna("")
        )
    head = f"# tirelog simulate\n# sampling rate: {next(iter(rates)):g} Hz\n"
    text = head + pd.DataFrame(columns).to_csv(index=False, lineterminator="\n")
    data = text.encode("utf-8")
    path.write_bytes(gzip.compress(data, 9, mtime=0) if zipped else data)
    return setup_text(scenario, sources, "time_s")


def _write_mcap(simulated: Simulated, path: Path, zipped: bool) -> str:
    """JSON messages, one sample each; channels of one sampling rate share a topic and its clock."""
    from mcap.writer import CompressionType, Writer

    groups: dict[float, list[str]] = {}
    for name, sensor in simulated.scenario.channels.items():
        groups.setdefault(sensor.sampling_rate_Hz, []).append(name)
    made = {}
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="", library="tirelog simulate")
        for rate, names in groups.items():
            topic = "/tire" if len(groups) == 1 else f"/tire/{rate:g}_Hz"
            made.update({name: f"{topic}:{name}" for name in names})
            # a lost sample is null
            fields = {name: {"type": ["number", "null"]} for name in names}
            schema = writer.register_schema(
                name=topic.strip("/"),
                encoding="jsonschema",
                data=json.dumps({"type": "object", "properties": fields}).encode(),
            )
            channel = writer.register_channel(
                topic=topic, message_encoding="json", schema_id=schema
            )
            texts = []
            for name in names:
                digits = _digits(simulated.scenario.channels[name])
                values = simulated.channels[name].tolist()
                texts.append([f"{v:.{digits}f}" if v == v else "null" for v in values])
            stamps = np.round(simulated.stamp_s[names[0]] * 1e9).astype(np.int64).tolist()
            for number, (stamp, *row) in enumerate(zip(stamps, *texts, strict=True)):
                body = ",".join(f'"{name}":{v}' for name, v in zip(names, row, strict=True))
                writer.add_message(channel, stamp, f"{{{body}}}".encode(), stamp, number)
        writer.finish()
    return setup_text(simulated.scenario, {**_sources(simulated), **made})


def _write_hdf5(simulated: Simulated, path: Path, zipped: bool) -> str:
    """Write the log as HDF5: one dataset per channel.

    With `sampling_rate_Hz` and `unit`; 16-bit counts with `scale` and `offset` for an instrument of
    up to 16 bits.

    The file is made in memory: HDF5 does not survive a disk that is full while it closes a file.
    """
    import h5py

    sources = {name: s if s.startswith("/") else f"/{s}" for name, s in _sources(simulated).items()}
    with h5py.File(path, "w", track_order=True, driver="core", backing_store=False) as file:
        for name, sensor in simulated.scenario.channels.items():
            values = simulated.channels[name]
            scale = None
            if (
                sensor.bits is not None
                and sensor.bits <= 16
                and sensor.range is not None
                and np.isfinite(values).all()
            ):
                scale = 2.0 * sensor.range / 2**sensor.bits
                values = np.clip(np.round(values / scale), -32768, 32767).astype(np.int16)
            data = file.create_dataset(
                sources[name],
                data=values,
                chunks=(min(1 << 15, max(values.size, 1)),),
                compression=9,
                shuffle=True,
            )
            data.attrs["sampling_rate_Hz"] = sensor.sampling_rate_Hz
            data.attrs["unit"] = SOURCE_UNITS[sensor.kind]
            if scale is not None:
                data.attrs["scale"], data.attrs["offset"] = scale, 0.0
        file.flush()
        image = file.id.get_file_image()
    path.write_bytes(image)
    return setup_text(simulated.scenario, sources)
