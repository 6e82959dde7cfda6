"""Time and memory of the commands and of what they are made of, beside what a user would write.

    python -m benchmarks [NAME...] [--minutes 2] [--logs 200]

A benchmark is a function of a folder and these numbers; each runs in a process of its own. Wall
seconds depend on what else the machine does, CPU seconds little. How right the numbers are is for
the tests to say.
"""

import gzip
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, hilbert, sosfiltfilt

from benchmarks.cases import Case, case
from benchmarks.family import FAMILY, write
from benchmarks.measure import Cost, apart, cost, median
from benchmarks.nuisance_worlds import CaseOf

TIRELOG = [sys.executable, "-m", "tirelog"]


@dataclass(frozen=True)
class Sizes:
    """Length of the logs [min], and how many of them a campaign has."""

    minutes: float = 2.0
    logs: int = 200


def say(what: str, spent: Cost | float, goal: str = "") -> Any:
    """Print a line, and give what was spent."""
    told = spent if isinstance(spent, Cost) else f"{spent:7.2f} s cpu"
    print(f"{what:44} {told}  {goal and f'goal: {goal}'}".rstrip(), flush=True)
    return spent


def command(what: str, *words: object, goal: str = "") -> Cost:
    """Print what a command of tirelog costs."""
    return say(what, cost([*TIRELOG, *map(str, words), "--quiet"]), goal)


def cpu(work: Callable[[], object], times: int = 1) -> float:
    """The least CPU seconds of some runs."""
    spent = []
    for _ in range(times):
        begun = time.process_time()
        work()
        spent.append(time.process_time() - begun)
    return min(spent)


def beside(what: str, other: Cost, ours: Cost) -> None:
    parts = other.wall_s / ours.wall_s, other.cpu_s / ours.cpu_s, other.peak_MB / ours.peak_MB
    print("{} / tirelog: {:.2f} x wall, {:.2f} x cpu, {:.1f} x memory".format(what, *parts))


def chain(folder: Path, sizes: Sizes) -> None:
    """Text to the strain tables, in one command and step by step, and help."""
    log, run, out = folder / "log.csv", folder / "run.h5", folder / "out"
    apart(write, FAMILY[0], log, sizes.minutes)
    print(f"{sizes.minutes:g} min x 16 gratings at 2.5 kHz, {log.stat().st_size / 1e6:.0f} MB")
    script = [sys.executable, "-m", "benchmarks.plain_script", str(log), f"{out}.csv"]
    plain = say("plain script", cost(script))
    beside("plain script", plain, command("tables from the text", "tables", log, "-o", out))
    command("ingest", "ingest", log, "-o", run)
    for table in ("speed", "footprint", "dissipation"):
        command(f"{table} from the run", table, run, "-o", folder / f"{table}.csv")
    for words in (["--help"], ["speed", "--help"]):
        say(f"tirelog {' '.join(words)}", cost([*TIRELOG, *words]))


def family(folder: Path, sizes: Sizes) -> None:
    """Text to the tables on every log of the family, on two cores and on one."""
    log, out = folder / "log.csv", folder / "out"
    for one in FAMILY:
        passages = apart(write, one, log, sizes.minutes)
        words = [*TIRELOG, "tables", str(log), "-o", str(out)]
        script = [sys.executable, "-m", "benchmarks.plain_script", str(log), f"{out}.csv"]
        costs: dict[str, list[Cost]] = {"script": [], "two": [], "one": []}
        for _ in range(3):  # in turns: what else the machine does meets all of them
            costs["script"].append(cost([*script, one.surface]))
            costs["two"].append(cost(words))
            costs["one"].append(cost([*words, "--workers", "1"], one_core=True))
        told = {name: median(some) for name, some in costs.items()}
        say(f"{one.name}, {1e6 * told['two'].cpu_s / passages:.0f} us a passage", told["two"])
        beside("plain script", told["script"], told["two"])
        print(f"one core / two: {told['one'].wall_s / told['two'].wall_s:.2f} x wall")


OURS = """
from tirelog.runs.clock import ClockFit
from tirelog.readers.text.reader import open_text
from tirelog.data.setup import load_setup
reader = open_text(r"{log}", load_setup(r"{setup}"), "log")
clock = ClockFit(resolution_s=reader.groups[0].stamp_resolution_s)
for block in reader.blocks():
    clock.add(block.stamps_s, block.number, next(iter(block.values.values())).size)
assert clock.axis.rate_Hz == 2500.0 and not reader.report.losses
"""
PANDAS = {
    "pandas, whole file": 'import pandas as pd\npd.read_csv(r"{log}").to_numpy()',
    "pandas, in chunks": "import pandas as pd\n"
    'for part in pd.read_csv(r"{log}", chunksize=50_000):\n    part.to_numpy()',
}


def text(folder: Path, sizes: Sizes) -> None:
    """Text to arrays with stamps and flags; pandas gives the numbers alone."""
    log = folder / "log.csv"
    apart(write, FAMILY[0], log, sizes.minutes)
    found = {}
    for way, program in {"tirelog": OURS, **PANDAS}.items():
        words = [sys.executable, "-c", program.format(log=log, setup=log.with_suffix(".toml"))]
        found[way] = say(way, median([cost(words) for _ in range(3)]))
    for way in PANDAS:
        beside(way, found[way], found["tirelog"])


def mcap(folder: Path, sizes: Sizes) -> None:
    """MCAP of one sample a message, checksums verified, beside the library's own decoding."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    from tests.readers.logs import setup_of
    from tests.readers.mcap_files import MULTI_ARRAY, START_NS, write_ros2
    from tirelog.data.setup import Setup
    from tirelog.readers.mcap.reader import McapLog

    log, messages = folder / "log.mcap", 60_000
    for width in (16, 1):
        values = 1550.0 + np.random.default_rng(1).normal(size=(messages, width)).round(4)
        layout, name = {"dim": [], "data_offset": 0}, "std_msgs/msg/Float64MultiArray"
        rows = (
            ("/fbg", START_NS + n * 400_000, name, MULTI_ARRAY, {"layout": layout, "data": row})
            for n, row in enumerate(values.tolist())
        )
        write_ros2(log, rows, chunk_size=1 << 20)
        sources = {f"c{k}": f"/fbg:data[{k}]" for k in range(width)}
        setup = setup_of(sources, kind="temperature")

        def library() -> None:
            with log.open("rb") as stream:
                made = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
                for *_, message in made.iter_decoded_messages():
                    list(message.data)

        def ours(setup: Setup = setup) -> None:
            with log.open("rb") as stream:
                list(McapLog(stream, setup, "log").blocks())

        theirs = say(f"{width} values a message, library", cpu(library))
        own = say(f"{width} values a message, tirelog", cpu(ours, 3))
        print(f"library / tirelog: {theirs / own:.1f} x cpu (goal: 10)")


def encoder(folder: Path, sizes: Sizes) -> None:
    """Wheel angle beside a band-pass and a Hilbert transform; phase shift by the command."""
    import h5py

    from tests.kernel_calls import WHEEL
    from tests.wheel.phase_truth import Drive, Encoder, Tread, recording
    from tirelog.wheel.angle import encoder_of

    end = 60 * sizes.minutes
    drive = Drive((0, end / 4, end / 3, 2 * end / 3, end), (10, 10, 22, 22, 10))
    volts, g = Encoder().signal(drive), Tread().signal(drive) / 9.80665
    band = butter(4, [100, 1200], "band", fs=10_000, output="sos")

    def script() -> None:
        np.unwrap(np.angle(hilbert(sosfiltfilt(band, volts))))

    say(f"{volts.size / 1e6:.1f} M samples, script", cpu(script, 3))
    found = recording(drive, volts)
    say("wheel angle at every sample", cpu(lambda: encoder_of(found)[1].angle.at(drive.time), 3))
    log = folder / "log.h5"
    with h5py.File(log, "w") as file:
        for name, values, unit in (("encoder", volts, "V"), ("acceleration", g, "g")):
            data = file.create_dataset(name, data=values.astype("f4"), chunks=(1 << 17,))
            data.attrs["unit"], data.attrs["sampling_rate_Hz"] = unit, 10_000.0
    log.with_suffix(".toml").write_text(WHEEL)
    command("phase-shift", "phase-shift", log, "-o", folder / "table.csv")


def strain(folder: Path, sizes: Sizes) -> None:
    """Passages, footprint and dissipation of one grating."""
    from tests.strain.conftest import RADIUS_M, make_drive
    from tests.strain.strain_truth import Beam
    from tirelog.strain.dissipation import dissipation
    from tirelog.strain.footprint.footprint import footprint
    from tirelog.strain.passages.find import find_passages

    end = 60 * sizes.minutes
    knots, speeds = [0, end / 4, end / 2, end], [8, 22, 14, 20]
    made = make_drive(knots, speeds, seed=3010, pulse=Beam(), height=1.0, drift=0.0)
    passages = find_passages(made.channel, RADIUS_M)
    say(f"{len(passages)} passages", cpu(lambda: find_passages(made.channel, RADIUS_M)))
    say("footprint", cpu(lambda: footprint(made.channel, passages)))
    say("dissipation", cpu(lambda: dissipation(made.channel, passages, None, passages.quality)))


def model(folder: Path, sizes: Sizes) -> None:
    """Predictions of 2,000 revolutions at 256 angles, and a fit to 400 of them."""
    from tirelog.data.recording import Conditions, Stack
    from tirelog.diagnosis.fitted import fit_of_logs
    from tirelog.physics import Model
    from tirelog.physics.spectral import Angles

    def conditions(n: int) -> Conditions:
        random = np.random.default_rng(1)
        return Conditions.of(
            n, speed_m_s=random.uniform(9.0, 25.0, n), acceleration_m_s2=random.normal(0, 1.5, n),
            time_s=np.sort(random.uniform(0.0, 60.0, n)), distance_km=2e4, water_depth_mm=1.0,
            load_N=3500.0,
        )  # fmt: skip

    def probed(carcass: str, *effects: str) -> Any:
        made = Model.new(carcass)
        for name in effects:
            made = made.with_effect(name)
            sizes = {f"{name}.{p.name}": p.probe for p in made.effects[-1].parameters}
            made = made.with_values(sizes)
        return made

    n, angles, random = 2000, 256, np.random.default_rng(3)
    grid = (np.arange(angles) + 0.5) * 2.0 * np.pi / angles - np.pi
    phi, variance = grid + random.normal(0.0, 0.002, (n, angles)), np.full((n, angles), 1e-5)
    five = ("viscous_damping", "load_transfer", "traction", "water_film", "sensor_lag")
    kinds = (("beam",), ("beam", *five), ("beam", "stiffening"), ("beam", "ring_curvature"))
    for kind in (*kinds, ("ring",)):
        made = probed(*kind)
        work = partial(made.predict, conditions(n), Angles(phi, variance))
        say(f"predict {n} x {angles}, {' '.join(kind)[:24]}", cpu(work, 2), "0.5 s for five")
    n, noise, four = 400, 2e-6, [name for name in five if name != "traction"]
    drive, truth, start = conditions(n), probed("beam", *four), Model.new("beam")
    for name in four:
        start = start.with_effect(name)
    fixed = start.parameters["water_film.length"].fixed()
    start = start.with_parameters({"water_film.length": fixed})
    values = truth.predict(drive, Angles(phi[:n], variance[:n]))
    stack = Stack(
        "strain", "strain_1", "outer", 0.3126, values + noise * random.normal(size=(n, angles)),
        grid, phi[:n], variance[:n], np.ones((n, angles), int), np.full(n, noise), drive,
        np.zeros(n, np.int64), np.arange(n) // 40, np.arange(n), np.full(n, "cruise"), ("log",),
    )  # fmt: skip
    say(f"fit to {n}", cpu(lambda: fit_of_logs([stack], start)), "5 s")


def coupled(folder: Path, sizes: Sizes) -> None:
    """A second of the coupled ring over a cleat, as `model predict --road` does it."""
    setup = Path(__file__).parents[1] / "sample_data" / "cleat.toml"
    made = folder / "ring.toml"
    command("model new", "model", "new", "--carcass", "coupled_ring", "--setup", setup, "-o", made)
    road = "cleat,height_m=0.01,length_m=0.04,position_m=0.5"
    asked = ["--setup", setup, "--speed", 20, "--road", road, "--duration", 1.0]
    out = ["--sensor", 90, "--sensor", 180, "-o", folder / "passed.csv"]
    command("a cleat, two sensors", "model", "predict", made, *asked, *out, goal="5 s")


def diagnose(folder: Path, sizes: Sizes) -> None:
    """2,000 revolutions and every candidate: nothing hidden, one effect, a pair."""
    from tirelog.diagnosis.diagnose import diagnose
    from tirelog.inference.stacks.cut import stacks_from_logs
    from tirelog.physics import Model
    from tirelog.simulation import simulate, to_recording

    hidden: tuple[tuple[str, ...], ...]
    hidden = ((), ("viscous_damping",), ("water_film", "load_transfer"))
    for effects in hidden:
        logs = case(effects, seed=900, how=Case(logs=4, duration=1.07))
        recordings = [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)]
        stacks = stacks_from_logs(recordings)
        work = partial(diagnose, stacks, Model.new("beam", radius_m=0.305))
        say(f"hidden: {' '.join(effects) or 'nothing'}", cpu(work), "20 s on two cores")


def gratings(folder: Path, sizes: Sizes) -> None:
    """`diagnose --channel all` on two logs of a minute with 4 and with 16 gratings."""
    for count in (4, 16):
        for world, effect in (("control", ""), ("run_out_30", ""), ("control", "viscous_damping")):
            logs, made = folder / f"{count}{world}{effect}", folder / "model.toml"
            scenarios = CaseOf(world, 900, "beam", effect, 0.5).tables()
            for tables in scenarios:
                one = tables["channels"].pop("strain_1")
                for i in range(count):
                    angle = round(360.0 * i / count + (i * 7 % 5) * 0.4, 1)
                    own = {**one, "source": f"CH{i + 1}", "angle_deg": angle}
                    tables["channels"][f"g{i + 1}"] = own
            paths = apart(simulated, logs, scenarios)
            setup = paths[0].with_suffix(".toml")
            cost([*TIRELOG, "model", "new", "--setup", str(setup), "-o", str(made)])
            words = ["diagnose", *paths, "--model", made, "--channel", "all"]
            command(f"{count} gratings, {effect or world}", *words, goal="60 s, 1 GB")
            made.unlink()


def simulated(folder: Path, scenarios: Iterable[dict[str, Any]]) -> list[Path]:
    from tirelog.simulation import scenario_of, simulate, write_log

    folder.mkdir(exist_ok=True)
    return [
        write_log(simulate(scenario_of(tables)), folder / f"drive_{number:03}.csv")[0]
        for number, tables in enumerate(scenarios)
    ]


MANIFEST = """[campaign]
output = "results"
[[logs]]
glob = "logs/*.csv*"
[tables.speed]
[tables.footprint]
[tables.dissipation]
"""


def campaign(folder: Path, sizes: Sizes) -> None:
    """Logs of two minutes and four gratings, ten of them broken: one core, two, and unchanged."""
    logs, manifest = folder / "logs", folder / "campaign.toml"
    good = apart(simulated, logs, drives(sizes.logs - 10))
    start = good[0].read_bytes()
    setup = good[0].with_suffix(".toml").read_text()
    ways = (b"", start[:40], b"a,b\n1,2\n" * 99, gzip.compress(start)[:3000], bytes(range(256)))
    for number, data in enumerate((*ways, *(start[: 200 + 9 * k] for k in range(5)))):
        log = logs / f"broken_{number}.csv{'.gz' if number == 3 else ''}"
        log.write_bytes(data)
        log.with_suffix(".toml").write_text(setup)
    manifest.write_text(MANIFEST)
    spent = {}
    for workers in (1, 2):
        output = folder / f"results_{workers}"
        manifest.write_text(MANIFEST.replace("results", output.name))
        shell = f'"$@" > {output}.said 2>&1; test $? = 3'  # 3: some logs failed
        words = [*TIRELOG, "campaign", "run", str(manifest), "--workers", str(workers)]
        spent[workers] = say(f"{workers} workers", cost(["sh", "-c", shell, "sh", *words]))
    say("unchanged", cost(["sh", "-c", shell, "sh", *words]), "2 s")
    gain = spent[1].wall_s / spent[2].wall_s
    print(f"two cores against one: {gain:.2f} x (goal: 1.8)")


def drives(count: int) -> list[dict[str, Any]]:
    """Scenarios of drives, each other speeds under another load."""
    made = []
    for seed in range(9000, 9000 + count):
        (tables,) = replace(CaseOf("control", seed, "beam", "water_film"), logs=1).tables()
        one = tables["channels"].pop("strain_1")
        for n in range(4):
            own = {**one, "source": f"CH{n + 1}", "angle_deg": (one["angle_deg"] + 90.0 * n) % 360}
            tables["channels"][f"strain_{n + 1}"] = own
        made.append(tables)
    return made


BENCHMARKS: dict[str, Callable[[Path, Sizes], None]] = {
    made.__name__: made
    for made in (
        *(chain, family, text, mcap, encoder, strain, model, coupled, diagnose, gratings),
        campaign,
    )
}
