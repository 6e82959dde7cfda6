"""What `compare` does with logs whose setup has a [road]: obstacles found, steady revolutions kept apart, the model's answer compared.

recordings --`watched`--> the same, the observed channel of those with a road kept --stacks--> `parted`: steady stacks, TransientLogs
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tirelog.discrepancy.stacks import Stacks
    from tirelog.discrepancy.transient import TransientComparison
    from tirelog.discrepancy.transient_log import TransientLog
    from tirelog.recording import Recording

TABLES = ("hit", "time", "frequency")


def watched(recordings: Iterable[Recording], observable: str, channel: str | None, kept: dict[str, Recording]) -> Iterator[Recording]:
    """The recordings as they come; of those that met an obstacle the observed channel is kept in memory, by log."""
    from tirelog.discrepancy.stack import observe_channel
    from tirelog.physics.carcass import WAVEFORMS
    from tirelog.recording import Channel, TimeAxis

    for recording in recordings:
        if recording.setup.road.kind != "flat" and observable in WAVEFORMS:
            source = observe_channel(recording, observable, channel)
            axis = replace(TimeAxis.of_times(source.axis.time()), rate_Hz=source.axis.rate_Hz)
            copy = Channel.of_array(source.name, source.kind, source.read(), axis, surface=source.surface)
            kept[recording.log] = replace(recording, channels={source.name: copy})
        yield recording


def parted(stacks: Stacks, kept: dict[str, Recording]) -> tuple[Stacks, list[TransientLog]]:
    """The stacks without the revolutions that an obstacle disturbs, and the logs that met one."""
    from tirelog.discrepancy.stacks import Stacks, joined
    from tirelog.discrepancy.transient_log import steady_revolutions, transient_log

    if not kept:
        return stacks, []
    found, steady = [], Stacks()
    for number, log in enumerate(stacks.logs):
        recording = kept.get(log)
        if recording is None:
            steady.add(log, stacks.of_log(number))
            continue
        stack = joined(stacks.of_log(number))  # its samples are in memory as a whole too
        found.append(transient_log(recording, recording.channels[stack.channel], stack))
        steady.add(log, [steady_revolutions(stack, found[-1].hits_s)])
    steady.number_through()  # a manoeuvre may have gone with its revolutions
    return steady, found


def transients_page(result: TransientComparison) -> None:
    """The hits to read."""
    from tirelog.cli.discrepancy_page import _console, _table, shown

    out = _console()
    factor, unit = shown(result.observable, result.unit)
    total = result.to_json()
    out.print(
        f"obstacles: {len(result.hits)} hits; the model covers {100.0 * total['covered']:.0f} % of what they added "
        f"({total['nuisance_parameters']} nuisance numbers: when, phase, level and alignment of each)"
    )
    names = ["added", "missed", "rmse", "rmse_steady", "noise_floor", "excess"]
    rows = [
        [f"  {row['log']} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s", row["speed_m_s"], *(row[name] * factor for name in names)]
        for row in result.tables["hit"]
    ]
    out.print(_table([f"in {unit}", "m/s", "added", "missed", "rmse", "steady", "floor", "excess"], rows))


def draw_transients(result: TransientComparison, path: Path) -> Path:
    """The picture of the hits, beside the comparison's: NAME_transient.SUFFIX."""
    from tirelog.plots.transient import draw

    beside = path.with_name(f"{path.stem}_transient{path.suffix}")
    draw(result, beside)
    return beside
