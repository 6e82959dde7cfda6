"""Logs with known truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as File

from tirelog.api.logs import Path
from tirelog.errors import UsageError
from tirelog.simulation import Scenario, load_scenario, write_log
from tirelog.simulation import simulate as drive
from tirelog.simulation.sensors.writers import setup_of, suffix_of, truth_of
from tirelog.storage.whole import refuse_inputs


def simulate(scenario: Path, output: Path, *, seed: int | None = None) -> tuple[File, ...]:
    """A log with known truth, by physics solved apart from the models.

    Parameters
    ----------
    scenario : str or os.PathLike
        TOML file: manoeuvres, tire, road, sensors, effects, seed (see sample_data/README.md).
    output : str or os.PathLike
        The log to write; its suffix decides: .csv, .txt, .mcap or .h5.
    seed : int, optional
        Another seed than the scenario's.

    Returns
    -------
    tuple of pathlib.Path
        The files written: the log, LOG.truth.json and its setup.

    Raises
    ------
    UsageError
        No such format, or the log's setup would take the scenario's place.
    """
    return simulated_log(scenario, output, seed=seed)[1]


def simulated_log(
    scenario: Path, output: Path, *, seed: int | None = None
) -> tuple[Scenario, tuple[File, ...]]:
    """(what was driven, the files written) of `simulate`."""
    source, log = File(scenario), File(output)
    suffix_of(log)
    for path, what in (
        (log, "is the scenario itself"),
        (setup_of(log), "its setup would take the scenario's place"),
    ):
        if path.resolve() == source.resolve():
            named = "allowed is a log of another name"
            raise UsageError(what, allowed=named, do="change -o", file=log)
    refuse_inputs(truth_of(log), setup_of(log))
    described = load_scenario(source)
    files = write_log(drive(described if seed is None else replace(described, seed=seed)), log)
    return described, tuple(files)
