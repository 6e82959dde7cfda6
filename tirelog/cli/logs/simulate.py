"""`tirelog simulate SCENARIO -o LOG`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.cli.targets import in_a_folder


def simulate(
    scenario: Annotated[
        Path, typer.Argument(help="TOML file: manoeuvres, tire, road, sensors, effects, seed.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="The log: .csv, .txt, .mcap or .h5.", callback=in_a_folder
        ),
    ],
    seed: Annotated[
        int | None, typer.Option("--seed", help="Another seed than the scenario's.")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log with known truth: LOG, LOG.truth.json and its setup.

    A scenario's truth is "beam" or "ring", steady at every instant, or "coupled_ring", a tire that
    moves: over the [road] (flat, step, cleat, sine, profile), under [[load_steps]], through every
    [[manoeuvres]]. The keys are explained in sample_data/README.md.
    """
    from tirelog.api.simulated import simulated_log

    session = Session(quiet=quiet)
    with session.working() as line:
        line.say(f"driving {scenario}")
        described, files = simulated_log(scenario, output, seed=seed)
    planted = ", ".join(effect.name for effect in described.effects) or "no effect"
    session.note(
        f"{described.duration_s:g} s of log with {planted} planted; "
        f"wrote {', '.join(str(f) for f in files)}"
    )
