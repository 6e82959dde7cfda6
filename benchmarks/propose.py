"""The self-test of `propose`: unknown effects that the simulator makes, nulls, nuisance worlds.

    python -m benchmarks.propose --seeds A-B [--worlds control,drift,...] [--sizes large,small]
                                 [--forms all|none|NAME,...] [--jobs 2] [-o rows.csv]
    python -m benchmarks.propose --summary rows.csv     rates with Wilson intervals

Each seed takes one form in turn (`--forms all`: every one; `none`: nothing is planted). Seeds below
1000 plant the forms of CHOOSING in tuning worlds, others those of REPORTING in reporting worlds:
what was looked at while the grammar was written is never reported. The truth is the simulator's
beam with a strain that the simulator itself evaluates, never the model's expression.
"""

from __future__ import annotations

import argparse
import csv
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import tirelog
from benchmarks.hidden import wilson
from benchmarks.nuisance_worlds import FIRST_REPORTING, CaseOf
from tirelog.diagnosis.propose.grammar import EXPONENTS, FRAMES
from tirelog.diagnosis.propose.propose import FoundFormula, Term
from tirelog.errors import TirelogError
from tirelog.physics.model.file import new_model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import PLANTABLE, Plantable, Planted, Scenario
from tirelog.simulation.steady import loads
from tirelog.simulation.steady.loads import Instants, Ring
from tirelog.vocabulary.arrays import FloatArray

#: excess of a planted effect that is drawn [squared floors]
SIZES = {"large": (10.0, 60.0), "small": (2.0, 10.0)}
#: the amplitude that a size is measured with
_TRIAL = 1e-4
#: an amplitude is found by at most so many refits, to this difference of logarithms of the excess;
#: an excess below the least one is noise
_STEPS, _NEAR, _SEEN = 4, 0.15, 0.1
#: 95 % of a normal distribution
_SIGMAS = 1.96


@dataclass(frozen=True)
class Place:
    """Coordinates of the tread (b, points) for a form, and what it is driven under (b, 1)."""

    since_m: FloatArray
    before_m: FloatArray
    xi_m: FloatArray
    u: FloatArray
    phi: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    load: FloatArray
    time_s: FloatArray

    @property
    def since_s(self) -> FloatArray:
        return self.since_m / self.speed

    @property
    def before_s(self) -> FloatArray:
        return self.before_m / self.speed


@dataclass(frozen=True)
class Unknown:
    """A form of unit size over a place.

    `frame` as the grammar names it, `law` the condition that it grows with and its power ("1":
    none); `profile` in the grammar's words if it has the form, then with its true `numbers`.
    """

    form: Callable[[Place], FloatArray]
    frame: str
    law: tuple[str, float]
    profile: str = ""
    numbers: Mapping[str, float] | None = None

    @property
    def inside(self) -> bool:
        """Has the grammar this form?"""
        return bool(self.profile)


def _v(x: Place) -> FloatArray:
    return x.speed / 20.0


def _chirp(x: Place) -> FloatArray:
    t = x.since_s
    turns = 60.0 * t + 120.0 * 0.01 * (1.0 - np.exp(-t / 0.01))
    return np.exp(-t / 0.012) * np.sin(2.0 * np.pi * turns) * _v(x)


def _rectified(x: Place) -> FloatArray:
    return np.maximum(np.cos(x.phi - 2.0), 0.0) ** 3 * _v(x) ** 2


def _lorentz(x: Place) -> FloatArray:
    return -x.acceleration / 3.0 / (1.0 + ((x.u + 1.6) / 0.3) ** 2)


def _stretched(x: Place) -> FloatArray:
    return np.exp(-((x.since_s / 0.015) ** 0.6))


#: looked at while grammar and thresholds were chosen
CHOOSING: Mapping[str, Unknown] = {
    "chirp": Unknown(_chirp, "time_since_exit", ("speed", 1.0)),
    "rectified": Unknown(_rectified, "wheel_angle", ("speed", 2.0)),
    "lorentz": Unknown(_lorentz, "patch", ("acceleration", 1.0)),
    "stretched": Unknown(_stretched, "time_since_exit", ("1", 0.0)),
    "ring": Unknown(
        lambda x: np.exp(-x.since_s / 0.01) * np.sin(2 * np.pi * 110.0 * x.since_s) * _v(x),
        "time_since_exit", ("speed", 1.0), "ringing", {"decay": 0.01, "f": 110.0},
    ),
    "odd": Unknown(
        lambda x: x.xi_m / 0.11 * np.exp(0.5 - 0.5 * (x.xi_m / 0.11) ** 2) * x.load / 3500.0,
        "tread", ("load", 1.0), "odd wave", {"width": 0.11},
    ),
    "echo": Unknown(
        lambda x: np.exp(-0.5 * ((x.since_s - 0.009) / 0.0016) ** 2),
        "time_since_exit", ("1", 0.0), "bump", {"at": 0.009, "width": 0.0016},
    ),
}  # fmt: skip


def _beats(x: Place) -> FloatArray:
    t = x.since_s
    wave = np.sin(2.0 * np.pi * 95.0 * t) + np.sin(2.0 * np.pi * 130.0 * t)
    return 0.5 * np.exp(-t / 0.014) * wave * _v(x)


def _slow(x: Place) -> FloatArray:
    return _v(x) ** 2 / (1.0 + x.since_m / 0.06) ** 2.5


def _saw(x: Place) -> FloatArray:
    off = np.mod(x.phi + 1.1, 2.0 * np.pi)
    return np.where(off < 0.9, off / 0.9, np.maximum(1.0 - (off - 0.9) / 0.25, 0.0))


def _flat_top(x: Place) -> FloatArray:
    off = np.angle(np.exp(1j * (x.phi + 2.2)))
    return _v(x) / (1.0 + (off / 0.35) ** 8)


def _step(x: Place) -> FloatArray:
    return x.acceleration / 3.0 * (np.tanh((x.u + 1.0) / 0.25) - np.tanh((x.u - 1.4) / 0.5)) / 2.0


def _herald(x: Place) -> FloatArray:
    b = x.before_m
    return (b / 0.05) ** 2 / (1.0 + (b / 0.05) ** 4) * x.load / 3500.0


def _saturating(x: Place) -> FloatArray:
    off = np.angle(np.exp(1j * (x.phi - 1.4)))
    return np.exp(-np.abs(off) / 0.25) * x.speed**2 / (x.speed**2 + 15.0**2)


def _packet(x: Place) -> FloatArray:
    t = x.since_s
    return np.exp(-0.5 * ((t - 0.012) / 0.005) ** 2) * np.cos(2 * np.pi * 160.0 * t) * _v(x) ** 2


#: never looked at before a report
REPORTING: Mapping[str, Unknown] = {
    "beats": Unknown(_beats, "time_since_exit", ("speed", 1.0)),
    "slow_decay": Unknown(_slow, "distance_since_exit", ("speed", 2.0)),
    "saw": Unknown(_saw, "wheel_angle", ("1", 0.0)),
    "flat_top": Unknown(_flat_top, "wheel_angle", ("speed", 1.0)),
    "step": Unknown(_step, "patch", ("acceleration", 1.0)),
    "herald": Unknown(_herald, "distance_before_entry", ("load", 1.0)),
    "saturating": Unknown(_saturating, "wheel_angle", ("speed", 1.0)),
    "packet": Unknown(_packet, "time_since_exit", ("speed", 2.0)),
    "ring": Unknown(
        lambda x: np.exp(-x.since_s / 0.006) * np.sin(2 * np.pi * 210.0 * x.since_s) * _v(x) ** 2,
        "time_since_exit", ("speed", 2.0), "ringing", {"decay": 0.006, "f": 210.0},
    ),
    "wave": Unknown(
        lambda x: np.exp(-x.before_m / 0.12) * np.sin(2 * np.pi * x.before_m / 0.2) * _v(x),
        "distance_before_entry", ("speed", 1.0), "ringing", {"decay": 0.12, "f": 5.0},
    ),
    "pulse": Unknown(
        lambda x: x.since_s / 0.005 * np.exp(1.0 - x.since_s / 0.005) * _v(x),
        "time_since_exit", ("speed", 1.0), "pulse", {"decay": 0.005},
    ),
    "bump": Unknown(
        lambda x: np.exp(-0.5 * (np.angle(np.exp(1j * (x.phi + 1.9))) / 0.14) ** 2) * _v(x) ** 2,
        "wheel_angle", ("speed", 2.0), "bump", {"at": -1.9, "width": 0.14},
    ),
    "flanks": Unknown(
        lambda x: (x.xi_m / 0.16) ** 2 * np.exp(1.0 - (x.xi_m / 0.16) ** 2) * x.load / 3500.0,
        "tread", ("load", 1.0), "flanks from zero", {"width": 0.16},
    ),
    "odd_braking": Unknown(
        lambda x: x.xi_m / 0.14 * np.exp(0.5 - 0.5 * (x.xi_m / 0.14) ** 2) * x.acceleration / 3.0,
        "tread", ("acceleration", 1.0), "odd wave", {"width": 0.14},
    ),
}  # fmt: skip


def _planted(unknown: Unknown) -> Callable[[Planted, Ring, Instants, FloatArray], FloatArray]:
    """The form as the simulator's strains are: (b, points) of unit amplitude."""

    def form(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
        turn = ring.circumference_m
        half = at.half_length[:, None]
        xi = np.broadcast_to(ring.xi_m, (len(at), ring.xi_m.size))
        column = {
            name: np.asarray(getattr(at, name), dtype=np.float64).reshape(-1, 1)
            for name in ("acceleration", "load", "time_s")
        }
        return unknown.form(
            Place(
                since_m=np.mod(xi - exit_m[:, None], turn),
                before_m=np.mod(-half - xi, turn),
                xi_m=np.mod(xi + 0.5 * turn, turn) - 0.5 * turn,
                u=(np.mod(xi + 0.5 * turn, turn) - 0.5 * turn) / half,
                phi=2.0 * np.pi * xi / turn,
                speed=np.maximum(at.speed, 0.2)[:, None],
                **column,
            )
        )

    return form


def forms_of(seed: int) -> Mapping[str, Unknown]:
    return REPORTING if seed >= FIRST_REPORTING else CHOOSING


def plant(name: str, unknown: Unknown) -> str:
    """The name under which the simulator knows a form from now on."""
    own = f"unknown_{name}"
    loads._EXTRA[own] = _planted(unknown)
    PLANTABLE[own] = Plantable(
        {"amplitude": _TRIAL, "speed_exponent": 0.0}, False, "", "", "", ("exact",)
    )
    return own


@dataclass(frozen=True)
class Row:
    """One case and what was proposed; errors in squared floors."""

    world: str
    seed: int
    planted: str
    inside: bool
    size: str
    excess: float
    status: str
    verdict: str
    terms: int
    share_locked: float
    after_locked: float
    frame: str
    law: str
    frame_right: bool
    law_right: bool
    in_set: bool
    covered: int
    numbers: int
    manoeuvres: int
    cpu_s: float
    sentence: str


@dataclass(frozen=True)
class Task:
    world: str
    seed: int
    planted: str
    size: str


def measured(scenarios: Iterable[Scenario]) -> tuple[Any, tirelog.Model]:
    """What the logs of a case give, and the model that a user would make from their setup."""
    recordings = [to_recording(simulate(s), f"log_{i + 1}") for i, s in enumerate(scenarios)]
    model, _ = new_model("beam", recordings[0].setup)
    return tirelog.measure(recordings, model), model


def scenarios_of(task: Task) -> list[Scenario]:
    """The logs of a task; a planted effect has the size drawn by seed and form."""
    bare = CaseOf(task.world, task.seed).scenarios()
    if not task.planted:
        return bare
    name = plant(task.planted, forms_of(task.seed)[task.planted])

    def with_amplitude(scenarios: list[Scenario], amplitude: float) -> list[Scenario]:
        given = {"amplitude": amplitude, "speed_exponent": 0.0}
        return [replace(s, effects=(*s.effects, Planted(name, "exact", given))) for s in scenarios]

    control = CaseOf("control", task.seed).scenarios()
    return with_amplitude(bare, amplitude_of(task, lambda a: with_amplitude(control, a)))


def amplitude_of(task: Task, planted: Callable[[float], list[Scenario]]) -> float:
    """The amplitude whose excess in the control world is the one drawn by seed and form.

    The excess is what a refitted model leaves [squared floors]; what it can take up itself is not
    counted, so that one step from the trial may end far from the size that is wanted.
    """
    low, high = SIZES[task.size]
    share = np.random.default_rng([task.seed, 19, sum(task.planted.encode())]).uniform()
    wanted = low * (high / low) ** share
    amplitude, best = _TRIAL, (_TRIAL, float("inf"))
    for _ in range(_STEPS):
        found, model = measured(planted(amplitude))
        seen = tirelog.compare(found, model)
        excess = (seen.rmse_heldout or 0.0) ** 2 / seen.noise_floor**2 - 1.0
        off = abs(np.log(max(excess, _SEEN) / wanted))
        if off < best[1]:
            best = amplitude, off
        if off < _NEAR:
            break
        amplitude *= float(np.clip((wanted / max(excess, _SEEN)) ** 0.5, 0.1, 10.0))
    return best[0]


def run(task: Task) -> Row:
    """A case from the scenario to the proposal."""
    unknown = forms_of(task.seed)[task.planted] if task.planted else None
    nan = float("nan")
    try:
        found, model = measured(scenarios_of(task))
        begun = time.process_time()
        result = tirelog.propose(found, model)
        seconds = time.process_time() - begun
    except TirelogError as problem:
        return Row(
            task.world, task.seed, task.planted, bool(unknown and unknown.inside), task.size, nan,
            "refused", "", 0, nan, nan, "", "", False, False, False, 0, 0, 0, nan, str(problem),
        )  # fmt: skip
    locked, best = result.locked, result.shapes[0] if result.shapes else None
    first = result.terms[0] if result.terms else None
    frame, law = _said(first) if first else (best.frame, best.law) if best else ("", "")
    right = [_right(unknown, *said) for said in _every_said(first, (frame, law))]
    covered, numbers = _covered(unknown, first)
    floor, before = result.noise_floor or nan, result.rmse_heldout_before or nan
    return Row(
        task.world,
        task.seed,
        task.planted,
        bool(unknown and unknown.inside),
        task.size if task.planted else "",
        before**2 / floor**2 - 1.0,
        result.status,
        result.diagnosis.verdict if result.diagnosis else "too_few",
        len(result.terms),
        nan if locked is None else locked["share_removed"],
        nan if locked is None else locked["rmse_after"] / locked["noise_floor"],
        frame,
        law,
        right[0][0],
        right[0][1],
        any(both == (True, True) for both in right),
        covered,
        numbers,
        result.manoeuvres,
        seconds,
        result.sentence,
    )


def _said(term: Term, formula: FoundFormula | None = None) -> tuple[str, str]:
    """(frame, law) of a term's formula as they are said, a free exponent with its fitted value."""
    formula = formula or term.formula
    law = formula.law
    for name in EXPONENTS:
        if name in term.numbers:
            law = re.sub(rf"\*\* {name}\b", f"** {term.numbers[name]['value']:.3g}", law)
    frame = next((f.name for f in FRAMES if formula.words.endswith(f.words)), "")
    return frame, law


def _every_said(term: Term | None, first: tuple[str, str]) -> list[tuple[str, str]]:
    """What is said first, and what is said to be as good."""
    return [first, *(_said(term, formula) for formula in (term.as_good if term else ()))]


def _right(unknown: Unknown | None, frame: str, law: str) -> tuple[bool, bool]:
    """Is the frame the true one, and the law?"""
    if unknown is None:
        return False, False
    return frame == unknown.frame, _same_law(law, unknown.law)


def _number(text: str) -> float:
    """An exponent; NaN, if it was left free and has no value."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _same_law(text: str, truth: tuple[str, float]) -> bool:
    """Does a law name the condition, and its power to a quarter?  A free exponent does not."""
    name, power = truth
    if name == "1":
        return text == "1"
    value = (
        _number(text.rpartition("** ")[2])
        if text.rpartition("** ")[1] and " * " not in text
        else 1.0
    )
    return f"({name} /" in text and " * " not in text and abs(value - power) < 0.26


def _covered(unknown: Unknown | None, term: Any) -> tuple[int, int]:
    """(how many true numbers lie within 95 %, of how many); (0, 0) of a term of another form."""
    if unknown is None or term is None or unknown.numbers is None:
        return 0, 0
    frame, _ = _said(term)
    if frame != unknown.frame or not term.formula.words.startswith(unknown.profile):
        return 0, 0
    own = unknown.numbers
    good = [
        abs(term.numbers[n]["value"] - v) <= _SIGMAS * (term.numbers[n]["se"] or 0.0)
        for n, v in own.items()
    ]
    return sum(good), len(good)


# ---- what the rows say --------------------------------------------------------------------------


def summary(rows: list[Row]) -> Iterator[str]:
    """The rates that are asked for."""
    quiet = [r for r in rows if not r.planted and r.status != "refused"]
    if quiet:
        for world in dict.fromkeys(r.world for r in quiet):
            of = [r for r in quiet if r.world == world]
            yield f"nothing planted, {world}: proposals {wilson(_count(of), len(of))}"
        yield f"nothing planted, all: proposals {wilson(_count(quiet), len(quiet))}"
    for size, share in (("large", 0.95), ("small", 0.85)):
        of = [r for r in rows if r.planted and r.size == size and r.status != "refused"]
        if not of:
            continue
        good = [r for r in of if r.share_locked >= share]
        yield f"{size}: {100 * share:.0f} % removed when locked {wilson(len(good), len(of))}"
        for inside in (True, False):
            some = [r for r in of if r.inside == inside]
            named = [r for r in some if r.share_locked >= share]
            where = "inside" if inside else "outside"
            yield f"    {where} of the grammar {wilson(len(named), len(some))}"
        said = [r for r in of if r.status in ("formula", "shape")]
        right = [r for r in said if r.frame_right and r.law_right]
        among = [r for r in said if r.in_set]
        yield f"    of proposals, frame and law right {wilson(len(right), len(said))}"
        yield f"    of proposals, right among those as good {wilson(len(among), len(said))}"
        bad = "; ".join(
            f"{r.planted} {r.world} {r.seed}: {r.status} {r.verdict} {r.share_locked:.2f}"
            for r in of
            if r not in good
        )
        yield f"    not: {bad or 'none'}"
    numbers = sum(r.numbers for r in rows)
    if numbers:
        yield f"95 % intervals cover {wilson(sum(r.covered for r in rows), numbers)}"
    refused = [r for r in rows if r.status == "refused"]
    if refused:
        yield f"{len(refused)} refused, as {refused[0].planted} {refused[0].seed}: " + (
            refused[0].sentence
        )
    seconds = sorted(r.cpu_s for r in rows if np.isfinite(r.cpu_s))
    if seconds:
        middle = seconds[len(seconds) // 2]
        yield f"{len(seconds)} cases, {middle:.1f} s of CPU each, {seconds[-1]:.1f} s at most"


def _count(rows: list[Row]) -> int:
    return sum(r.status in ("formula", "shape") for r in rows)


_PARSE: dict[str, Callable[[str], Any]] = {
    "str": str, "int": int, "float": float, "bool": lambda text: text == "True",
}  # fmt: skip


def read_rows(path: Path) -> list[Row]:
    """The rows of an earlier run."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [
            Row(**{f.name: _PARSE[str(f.type)](row[f.name]) for f in fields(Row)})
            for row in csv.DictReader(stream)
        ]


def tasks_of(options: argparse.Namespace) -> list[Task]:
    first, _, last = options.seeds.partition("-")
    tasks = []
    for seed in range(int(first), int(last or first) + 1):
        known = list(forms_of(seed))
        turn = [known[seed % len(known)]]
        named = {"turn": turn, "all": known, "none": [""]}.get(
            options.forms, ["" if name == "none" else name for name in options.forms.split(",")]
        )
        for world in options.worlds.split(","):
            for name in named:
                sizes = options.sizes.split(",") if name else [""]
                tasks += [Task(world, seed, name, size) for size in sizes]
    return tasks


def main() -> None:
    """Run cases, or sum up what has run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="20000-20000")
    parser.add_argument("--worlds", default="control")
    parser.add_argument("--forms", default="turn")
    parser.add_argument("--sizes", default="large")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--summary", type=Path)
    options = parser.parse_args()
    if options.summary:
        print("\n".join(summary(read_rows(options.summary))))
        return
    rows, tasks = [], tasks_of(options)
    with ProcessPoolExecutor(options.jobs) as pool:
        for row in map(run, tasks) if options.jobs == 1 else pool.map(run, tasks):
            rows.append(row)
            print(
                f"{row.world} {row.seed} {row.planted or 'none'} {row.size}: {row.status} "
                f"({row.verdict}, excess {row.excess:.2f}, locked {row.share_locked:.3f}, "
                f"{row.terms} terms, {row.frame} x {row.law}, {row.cpu_s:.1f} s)",
                flush=True,
            )
            if options.output:
                with options.output.open("a", newline="", encoding="utf-8") as stream:
                    writer = csv.DictWriter(stream, [f.name for f in fields(Row)])
                    if stream.tell() == 0:
                        writer.writeheader()
                    writer.writerow(asdict(row))
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
