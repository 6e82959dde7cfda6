"""What is left to do about a setup: implausible, missing, unused, guessed."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

from tirelog.data.plausibility import check_recording
from tirelog.data.recording import Recording
from tirelog.data.setup import Setup
from tirelog.drafts.contents import Contents, contents
from tirelog.drafts.setup import marks
from tirelog.drafts.surface import likely_surface
from tirelog.errors import DataLoss, ReadError, SetupError, UsageError
from tirelog.runs.ingest import is_file
from tirelog.runs.store import is_run
from tirelog.strain.passages.surface import passages_of
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.quality import Quality, having
from tirelog.wheel.phase_shift import measure_phase_shift
from tirelog.wheel.speed_table import encoder_speed

#: unused series that are named
_MOST_UNUSED = 20


@dataclass(frozen=True)
class Finding:
    """A sentence, and what it is about: implausible, missing, unused, guessed or said."""

    about: str
    sentence: str


def findings(recording: Recording, log: str) -> list[Finding]:
    """What is wrong or open in the setup of a recording that was opened unchecked.

    What of `log` is unused is told if it is a file that tirelog did not write itself.
    """
    setup = recording.setup
    out = [Finding("missing", loss) for loss in recording.losses]
    for name, channel in recording.channels.items():
        alone = replace(recording, channels={name: channel}, remarks=())
        try:
            found = [Finding("implausible", said) for said in check_recording(alone).remarks]
            out += [one for one in found if one not in out]  # what is said of a clock is said once
        except SetupError as problem:
            out.append(Finding("implausible", problem.message))
    out += _surfaces(recording)
    out += [Finding("implausible", said) for said in _motion(recording)]
    out += [Finding("said", remark) for remark in recording.remarks]
    out += [Finding("missing", said) for said in _missing(recording)]
    if is_file(log) and not is_run(log):
        with suppress(ReadError):  # nothing to list beside what was read
            out += _unused(setup, contents(log))
    across = [name for name, one in setup.channels.items() if one.lateral_m is not None]
    if across:
        said = f"lateral_m of {', '.join(across)}: models have no width, no number depends on it"
        out.append(Finding("unused", said))
    lines = marks(setup.text)
    if lines:
        some = ", ".join(map(str, lines[:10])) + (", ..." if len(lines) > 10 else "")
        word = "guess is" if len(lines) == 1 else "guesses are"
        out.append(Finding("guessed", f"{len(lines)} {word} still marked (lines {some})"))
    return out


def _surfaces(recording: Recording) -> list[Finding]:
    """Strain channels whose patch lies on the other side than their surface says."""
    out = []
    for channel in recording.of_kind(*STRAIN_KINDS):
        likely = likely_surface(channel)
        if likely and likely != channel.surface:
            side = "down" if likely == "outer" else "up"
            out.append(
                Finding(
                    "implausible",
                    f"channel {channel.name}: the patch takes the strain {side}, and surface = "
                    f'"{channel.surface}"; is it "{likely}"?',
                )
            )
    return out


def _motion(recording: Recording) -> list[str]:
    """What of rates, speeds, radii and accelerations is no tire's, a sentence once."""
    said, tire = list[str](), recording.setup.tire
    encoders = recording.of_kind("wheel_encoder")
    if not (tire.rolling_radius_m or tire.unloaded_radius_m):
        return said
    for channel in (*recording.of_kind(*STRAIN_KINDS, *ACCELERATION_KINDS), *encoders):
        with suppress(DataLoss, UsageError):  # no wheel that turns, or another surface
            try:
                if channel.kind == "wheel_encoder":
                    encoder_speed(recording)
                    continue
                passages = passages_of(recording, channel)
                if having(passages.quality, Quality.IMPLAUSIBLE).any():
                    said.append(passages.doubt)
                elif encoders and channel.kind in ACCELERATION_KINDS:
                    list(measure_phase_shift(recording))
            except SetupError as problem:
                said.append(problem.message)
    return list(dict.fromkeys(said))


def _missing(recording: Recording) -> list[str]:
    """What tables will ask for and the setup does not have."""
    setup, said = recording.setup, []
    tire = setup.tire
    strain = [one.name for one in recording.of_kind(*STRAIN_KINDS)]
    accelerometer = recording.of_kind("radial_acceleration")
    if (
        (strain or accelerometer)
        and tire.rolling_radius_m is None
        and tire.unloaded_radius_m is None
    ):
        said.append("[tire] rolling_radius_m or unloaded_radius_m, without which there is no speed")
    if strain and tire.area_m2 is None:
        said.append(
            "[tire] section_height_m and width_m, without which dissipation has no power per width"
        )
    for channel in recording.of_kind("wheel_encoder"):
        if setup.channels[channel.name].steps is None and channel.name in setup.channels:
            said.append(f"channel {channel.name}: steps, the teeth or counts of a turn")
    for name in strain:
        if setup.channels[name].surface is None:
            said.append(f"channel {name}: surface; outer is taken")
    return said


def _unused(setup: Setup, inside: Contents) -> list[Finding]:
    """Series of the log that no channel names."""
    used = {one.source.strip().strip("/").lower() for one in setup.channels.values()}
    windows = [one.window_nm for one in setup.channels.values() if one.window_nm is not None]
    rest = []
    for one in inside.found:
        names = {one.series.source.strip("/").lower(), one.series.place}
        inside_window = one.series.window_nm is not None and any(
            low <= sum(one.series.window_nm) / 2.0 <= high for low, high in windows
        )
        begun = any(
            source.startswith(tuple(f"{name}[" for name in names if name)) for source in used
        )
        if not (names & used or inside_window or begun):
            rest.append(one.series.source)
    if not rest:
        return []
    some = ", ".join(rest[:_MOST_UNUSED]) + (", ..." if len(rest) > _MOST_UNUSED else "")
    return [Finding("unused", f"{len(rest)} series of the log: {some}")]
