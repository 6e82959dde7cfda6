"""Golden copies of all that the sample logs give: tables, fits, verdicts; for a change that is to
move no number.

    python -m benchmarks.goldens write FOLDER       every table, fit, comparison and verdict of the
                                                    sample logs
    python -m benchmarks.goldens compare OLD NEW    each number that differs by more than the
                                                    tolerance
    python -m benchmarks.goldens keep [NAME...]     rewrite the goldens of the tests: answers by
                                                    question, `errors` and `mistakes`

What `keep` writes lies in tests/golden/answers, and tests/golden/test_answers.py holds each to it;
a change on purpose stands in CHANGELOG.md under "Numbers changed". A golden is made by the
commands, so that the package behind them may change. The verdicts of `make hidden` are compared too
where both folders hold a `hidden.csv` (python -m benchmarks.hidden -o FOLDER/hidden.csv).
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import re
import shutil
import sys
import tempfile
import tomllib
from base64 import b64decode
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import tomlkit

from tirelog import runtime
from tirelog.cli import run
from tirelog.runtime import one_thread

SAMPLES = Path(__file__).resolve().parents[1] / "sample_data"
ANSWERS = SAMPLES.parent / "tests" / "golden" / "answers"
MISTAKES = ANSWERS.parent / "mistakes.toml"
STRAIN = (
    "drive.csv.gz",
    "drive_messages.mcap",
    "cleat.csv.gz",
    "hidden_1.csv.gz",
    "hidden_2.csv.gz",
    "unknown_1.csv.gz",
    "unknown_2.csv.gz",
)
WHEEL = ("encoder.h5", "encoder_ramp.h5", "cleat.csv.gz")
#: carcass, logs that are compared together, observable
QUESTIONS = {
    "hidden_beam": ("beam", ("hidden_1.csv.gz", "hidden_2.csv.gz"), None),
    "hidden_ring": ("ring", ("hidden_1.csv.gz", "hidden_2.csv.gz"), None),
    "unknown_beam": ("beam", ("unknown_1.csv.gz", "unknown_2.csv.gz"), None),
    "drive_beam": ("beam", ("drive.csv.gz",), None),
    "drive_ring": ("ring", ("drive.csv.gz",), None),
    "drive_patch": ("beam", ("drive.csv.gz",), "patch_length"),
    "drive_dissipation": ("beam", ("drive.csv.gz",), "dissipation_factor"),
    "cleat_coupled": ("coupled_ring", ("cleat.csv.gz",), None),
    "encoder_beam": ("beam", ("encoder.h5", "encoder_ramp.h5"), "radial_acceleration"),
    "encoder_shift": ("beam", ("encoder.h5",), "phase_shift"),
}
#: relative and absolute; a number below the second counts as zero
TOLERANCE = (1e-6, 1e-9)
#: seconds and paths are no results
LEFT_OUT = ("seconds", "version", "file", "path")


#: logs that are simulated: the drives of hidden_1 and hidden_2 under another load scatter and with
#: other effects, for the verdicts that no sample log gets
MADE = {
    "quiet": (0.0, ""),
    "twin": (0.003, '[[effects]]\nname = "gauge_length"\nlength_m = 0.016\n'),
}
#: what the tests hold of each question
KEPT = {
    "drive_beam": ("compare", "fit", "diagnose", "form", "ladder", "propose", "report"),
    "drive_patch": ("compare", "diagnose"),
    "drive_dissipation": ("compare", "diagnose"),
    "encoder_shift": ("compare", "fit", "diagnose"),
    "encoder_beam": ("compare", "fit"),
    "hidden_beam": ("compare", "fit", "diagnose", "form", "ladder"),
    "unknown_beam": ("diagnose", "propose"),
    "cleat_coupled": ("compare", "diagnose"),
    **dict.fromkeys(MADE, ("diagnose",)),
}
GRATING = """\
[channels.a]
kind = "fbg_strain"
source = "CH1"
reference_wavelength_nm = 1550.0
"""
#: files that wrong uses are made of, beside log.csv, two sample logs and model.toml
WRONG_FILES = {
    "empty.csv": "",
    "header.csv": "time_s,CH1\n",
    "words.csv": "a letter\nwithout numbers\n",
    "nul.h5": "\x89HDF\r\n\x1a\n" + "\0" * 600,
    "magic.mcap": "MCAP0",
    "log.toml": '[tire]\nname = "t"\nunloaded_radius_m = 0.3\n[channels.a]\n'
    'kind = "fbg_strain"\nsource = "CH9"\nreference_wavelength_nm = 1550.0\n',
    "key.toml": GRATING + "[tire]\nrolling_radus_m = 0.3\n",
    "type.toml": GRATING + '[tire]\nrolling_radius_m = "wide"\n',
    "size.toml": GRATING + "[tire]\nrolling_radius_m = -0.3\n",
    "table.toml": "[tyre]\nrolling_radius_m = 0.3\n",
    "kind.toml": '[channels.a]\nkind = "fbg_stain"\nsource = "CH1"\n',
    "broken.toml": "[tire\nradius",
    "twice.toml": "[tire]\n[tire]\n",
    "carcass.toml": '[model]\ncarcass = "baem"\nobservable = "strain"\n',
    "observable.toml": '[model]\ncarcass = "beam"\nobservable = "strian"\n',
    "nothing.toml": "",
    "unit.toml": '[model]\ncarcass = "beam"\nobservable = "strain"\n'
    "[parameters.radius_mm]\nvalue = 3\n",
    "seed.toml": 'seed = "one"\n',
    "truth.toml": 'truth = "bean"\n',
    "planted.toml": "seed = 1\n[[manoeuvres]]\nduration_s = 2\nspeed_m_s = 9\n[[effects]]\n"
    'name = "waterfilm"\n',
    "slow.toml": "seed = 1\n" + GRATING + "[[manoeuvres]]\nduration_s = -2\nspeed_m_s = 9\n",
    "campaign.toml": "[campaing]\n",
    "old.csv": "log,channel\na,b\n",
}
#: a line each, as it is typed behind `tirelog`
WRONG_USES = """\
sped log.csv
speed
speed none.csv
speed log.csv --setp log.toml
speed log.csv
speed log.csv --setup none.toml
speed log.csv --setup key.toml
speed log.csv --setup type.toml
speed log.csv --setup size.toml
speed log.csv --setup table.toml
speed log.csv --setup kind.toml
speed log.csv --setup broken.toml
speed log.csv --setup twice.toml
speed empty.csv --setup drive.toml
speed header.csv --setup drive.toml
speed words.csv --setup drive.toml
speed nul.h5 --setup drive.toml
speed magic.mcap --setup drive.toml
speed drive.csv.gz --format cvs
speed drive.csv.gz -o table.xlsx
speed drive.csv.gz -o none/table.csv
speed drive.csv.gz -o drive.csv.gz
speed drive.csv.gz --channel strain_9
speed drive.csv.gz --channel
footprint log.csv --setup broken.toml
dissipation none.csv
phase-shift drive.csv.gz
inflation drive.csv.gz
slip drive.csv.gz
wheel-angle drive.csv.gz
ingest drive.csv.gz
ingest none.csv -o run.h5
tables drive.csv.gz
check old.csv
check old.csv --against none.csv
check none.csv --against old.csv
setup new none.csv -o new.toml
setup check drive.csv.gz --setup broken.toml
effects no_such_effect
effects --plot picture.bmp
simulate none.toml -o made.csv
simulate seed.toml -o made.csv
simulate truth.toml -o made.csv
simulate planted.toml -o made.csv
simulate slow.toml -o made.csv
simulate broken.toml -o made.csv
simulate seed.toml
simulate seed.toml -o made.xlsx
model new
model new --carcass baem -o new.toml
model new --preset P9 -o new.toml
model new --setup key.toml -o new.toml
model new --observable strian -o new.toml
model new --setup drive.toml --set radius=1 -o new.toml
model new --setup drive.toml --set radius_m=wide -o new.toml
model add model.toml waterfilm -o new.toml
model fit drive.csv.gz --model none.toml -o new.toml
model fit drive.csv.gz --model carcass.toml -o new.toml
model fit drive.csv.gz --model observable.toml -o new.toml
model fit drive.csv.gz --model nothing.toml -o new.toml
model fit drive.csv.gz --model unit.toml -o new.toml
model fit drive.csv.gz --model broken.toml -o new.toml
model set model.toml lever_arm=0,3
model set model.toml lever_arm_m=3mm
speed drive.csv.gz --from 100
compare drive.csv.gz
compare drive.csv.gz --model drive.toml
compare drive.csv.gz --model model.toml --by tyre
compare drive.csv.gz --model model.toml --plot picture.bmp
plot drive.csv.gz --kind pie -o picture.png
compare drive.csv.gz --model model.toml --effects none.py
diagnose drive.csv.gz --model model.toml --leave-one-out wheel
diagnose drive.csv.gz --model model.toml --format xml
propose drive.csv.gz --model carcass.toml
ladder drive.csv.gz --model drive.toml
form drive.csv.gz --model model.toml --channel strain_9
report
report drive.csv.gz -o report.pdf
report drive.csv.gz --model none.toml -o report.html
campaign run campaign.toml
campaign run none.toml
speed s3://me:s3cr3t@b/l.csv?X-Signature=s3cr3t --setup drive.toml
info https://host/l.csv
report file:///tmp/l.csv -o page.html
speed drive.csv.gz --setup gs://b/s.toml
speed drive.csv.gz -o s3://b/t.csv
tables drive.csv.gz -o s3://b/tables
phase-shift encoder.h5 --calibration a --calibrate b
phase-shift encoder.h5 --fit-forces
phase-shift encoder.h5 --zero slow
phase-shift encoder.h5 --calibration none.toml
footprint drive.csv.gz --cutoff fast
footprint inflation.csv.gz
dissipation inflation.csv.gz
dissipation drive.csv.gz --steady-step 0
dissipation drive.csv.gz --fit --from 1
dissipation drive.csv.gz --from 1 --plot page.png
footprint drive.csv.gz --friction-ratio 3
speed drive.csv.gz --calibrate-radius
slip encoder.h5 --fit""".splitlines()
#: a list of more numbers than these is kept as its count, mean, root mean square, first and last
LONG = 12
#: relative, of a number of an answer; below the second it counts as zero
ANSWER_TOLERANCE = (1e-5, 1e-12)
#: A minimiser stops where the square is flat to some 1e-8: the place is then known to the root of
#: it, and a standard error, which is a second derivative there, is no better. Machines differ so.
OPTIMISED = 1e-3
#: of its own error: by less than this a value has not moved
OF_ERROR = 1e-4
OPTIMISED_NAMES = re.compile(
    r"\b(se|value|strengths|parameters|terms|shapes|p|probe|form|formula|bands)\b"
)


class Outcome(NamedTuple):
    """What a command line leaves: its status and what it wrote."""

    status: int
    out: str
    err: str


def tirelog(folder: Path, *arguments: str) -> Outcome:
    """A command carried out in a folder."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
    # notices of slow work depend on the machine: kernels may have to be compiled first
    without_notices = patch.object(runtime, "notice", lambda _: None)
    with chdir(folder), redirect_stdout(out), redirect_stderr(err), without_notices:
        status = run(list(arguments))
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]  # type: ignore[attr-defined]
    return Outcome(status, *texts)


def logs_of(name: str) -> tuple[str, ...]:
    """The logs that a question is asked of."""
    return (f"{name}_1.csv", f"{name}_2.csv") if name in MADE else QUESTIONS[name][1]


def commands(name: str) -> dict[str, tuple[str, ...]]:
    """The commands of a question by what they answer, without the model that they take."""
    logs, model = logs_of(name), f"{name}.model.toml"
    return {
        "compare": ("compare", *logs, "--model", model, "-o", f"{name}.compare.json"),
        "by_speed": (
            *("compare", *logs, "--model", model, "--by", "speed"),
            *("-o", f"{name}.by_speed.csv"),
        ),
        "diagnose": ("diagnose", *logs, "--model", model, "-o", f"{name}.diagnose.json"),
        "fit": ("model", "fit", *logs, "--model", model, "-o", f"{name}.fitted.toml"),
        "ladder": ("ladder", *logs, "--model", model, "-o", f"{name}.ladder.json"),
        "form": ("form", *logs, "--model", model, "-o", f"{name}.form.json"),
        "propose": ("propose", *logs, "--model", model, "--format", "json"),
        "report": ("report", *logs, "--model", model, "-o", f"{name}.report.html"),
    }


def new_model(name: str) -> tuple[str, ...]:
    """The command that makes a question's model."""
    carcass, _, observable = QUESTIONS.get(name, ("beam", (), None))
    chosen = ("--observable", observable) if observable else ()
    setup = logs_of(name)[0].split(".")[0] + ".toml"
    new = ("model", "new", "--carcass", carcass, "--setup", setup)
    return (*new, *chosen, "-o", f"{name}.model.toml")


def prepare(folder: Path, name: str) -> None:
    """A question's logs, setups and model in a folder."""
    for log in logs_of(name):
        stem = log.split(".")[0]
        if name in MADE:
            scatter, effects = MADE[name]
            drive = (SAMPLES / "scenarios" / f"hidden_{stem[-1]}.toml").read_text()
            plain = drive.split("[[effects]]")[0]
            scenario = re.sub("load_scatter = .*", f"load_scatter = {scatter}", plain) + effects
            (folder / "scenario.toml").write_text(scenario)
            tirelog(folder, "simulate", "scenario.toml", "-o", log, "--quiet")
        else:
            for file in (log, f"{stem}.toml"):
                shutil.copy(SAMPLES / file, folder)
    tirelog(folder, *new_model(name), "--quiet")


def answer(folder: Path, name: str, verb: str) -> dict[str, Any]:
    """What a command answers to a question, in the short form of a golden."""
    done = tirelog(folder, *commands(name)[verb], "--quiet")
    given: Any = None
    made = next(iter(folder.glob(f"{name}.{'fitted' if verb == 'fit' else verb}.*")), None)
    if verb == "propose":
        given = json.loads(done.out or "null")
    elif verb == "report" and made:
        (page,) = re.findall(r'<script type="application/json" id="data">(.*?)<', made.read_text())
        figures = json.loads(page)["figures"]
        given = {key: [_numbers(t) for t in one["traces"]] for key, one in figures.items()}
    elif made:
        text = made.read_text()
        given = tomllib.loads(text) if verb == "fit" else json.loads(text)
    short = {"status": done.status, "said": done.err.splitlines(), "answer": _short(given)}
    return json.loads(json.dumps(short))  # type: ignore[no-any-return]


def _numbers(trace: dict[str, Any]) -> dict[str, Any]:
    """Name and numbers of a figure's trace."""
    found: dict[str, Any] = {
        key: trace[key] for key in ("name", "x", "y", "z", "r", "theta") if key in trace
    }
    for key, packed in found.items():
        if isinstance(packed, dict):
            found[key] = np.frombuffer(b64decode(packed["bdata"]), packed["dtype"]).tolist()
    return found


def _short(value: Any) -> Any:
    """Numbers by seven digits, long lists of them by five numbers, without what is no result."""
    if isinstance(value, dict):
        return {k: _short(v) for k, v in value.items() if not str(k).startswith(LEFT_OUT)}
    if isinstance(value, list | tuple):
        plain = [v for v in value if isinstance(v, int | float) and math.isfinite(v)]
        if len(plain) <= LONG or not all(isinstance(v, int | float | None) for v in value):
            return [_short(v) for v in value]
        mean, square = sum(plain) / len(plain), sum(v * v for v in plain) / len(plain)
        return [len(value), *(_short(v) for v in (mean, math.sqrt(square), plain[0], plain[-1]))]
    return float(f"{value:.7g}") if isinstance(value, float) else value


def moved(golden: Any, now: Any) -> list[str]:
    """What of an answer is no longer its golden, each with its place."""
    before, after = dict(_leaves("", golden)), dict(_leaves("", now))
    out = [f"{place}: gone" for place in before if place not in after]
    out += [f"{place}: new" for place in after if place not in before]
    for place in before:
        if place in after:
            relative, least = ANSWER_TOLERANCE
            error = before.get(f"{place.removesuffix('.value')}.se", "")
            if place.endswith(".value") and error:
                least = max(least, OF_ERROR * float(error))
            loose = OPTIMISED if OPTIMISED_NAMES.search(place) else relative
            if not same(before[place], after[place], (loose, least)):
                out.append(f"{place}: {before[place]} -> {after[place]}")
    return out


def kept_answers(name: str) -> dict[str, Any]:
    """All answers of a question that the tests hold."""
    one_thread()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        prepare(folder, name)
        return {verb: answer(folder, name, verb) for verb in KEPT[name]}


def keep(names: list[str]) -> None:
    """Rewrite goldens of the tests, those of all questions and the errors if none is named."""
    ANSWERS.mkdir(exist_ok=True)
    for kind, answered in (("errors", wrong_uses), ("mistakes", mistakes)):
        if not names or kind in names:
            with tempfile.TemporaryDirectory() as made:
                (ANSWERS / f"{kind}.txt").write_text(answered(Path(made)))
    chosen = [name for name in KEPT if name in names or not names]
    with ProcessPoolExecutor(2) as pool:
        for name, found in zip(chosen, pool.map(kept_answers, chosen), strict=True):
            lines = ",\n".join(f"{json.dumps(v)}: {json.dumps(a)}" for v, a in found.items())
            (ANSWERS / f"{name}.json").write_text("{\n" + lines + "\n}\n")


def wrong_uses(folder: Path) -> str:
    """What each wrong use is told, with its status; none leaves a file behind."""
    (folder / "log.csv").write_bytes(b"time_s,CH1\n" + b"0.0,1550.0\n" * 3)
    for log in ("drive.csv.gz", "unknown_1.csv.gz", "inflation.csv.gz", "encoder.h5"):
        shutil.copy(SAMPLES / log, folder)
        shutil.copy(SAMPLES / f"{log.partition('.')[0]}.toml", folder)
    tirelog(folder, "model", "new", "--setup", "drive.toml", "-o", "model.toml", "--quiet")
    for file, text in WRONG_FILES.items():
        (folder / file).write_text(text)
    told = []
    for line in WRONG_USES:
        before = sorted(folder.iterdir())
        done = tirelog(folder, *line.split())
        left = "" if sorted(folder.iterdir()) == before else "a file is left behind\n"
        told.append(f"$ tirelog {line}\n{done.status}\n{done.out[:300]}{done.err}{left}")
    return "\n".join(told)


def mistakes(folder: Path) -> str:
    """What is said of each mistake of MISTAKES, with the status; none leaves a file behind."""
    said = []
    for files in tomllib.loads(MISTAKES.read_text())["files"]:
        name, base = files["name"], files.get("base", {})
        (folder / "scenario.toml").write_text(tomlkit.dumps(base))
        for mistake in files["mistakes"]:
            text = mistake
            if isinstance(mistake, dict):
                text = tomlkit.dumps(base | mistake)
            elif isinstance(mistake, list):
                old, new = mistake
                text = files["text"].replace(old, new, 1) if old else f"{files['text']}\n{new}\n"
            (folder / name).write_text(text)
            before = sorted(folder.iterdir())
            done = tirelog(folder, *files["command"].split())
            left = "" if sorted(folder.iterdir()) == before else "a file is left behind\n"
            message = (done.out + done.err).replace(f"{folder}/", "")
            said.append(f"{name}: {mistake!r}\n{done.status}\n{left}{message}")
    return "\n".join(said)


def _commands_in(task: tuple[Path, list[tuple[str, ...]]]) -> list[str]:
    """Commands one after the other beside the samples; each with its status, which is golden."""
    folder, lines = task
    one_thread()
    said = []
    for line in lines:
        done = tirelog(folder, *line, "--quiet")
        if line[0] == "propose":
            name = line[line.index("--model") + 1].split(".")[0]
            (folder / f"{name}.propose.json").write_text(done.out or "null")
        said.append(f"{' '.join(line)}: {done.status}")
    return said


def write(folder: Path) -> None:
    """All goldens of the sample logs, two commands at a time."""
    folder.mkdir(parents=True, exist_ok=True)
    for sample in SAMPLES.iterdir():
        if sample.is_file():
            shutil.copy(sample, folder)
    tasks: list[list[tuple[str, ...]]] = []
    for log in STRAIN:
        stem = log.split(".")[0]
        tasks += [
            [(t, log, "-o", f"{stem}.{t}.csv")] for t in ("speed", "footprint", "dissipation")
        ]
    tasks += [[("speed", log, "-o", f"{log.split('.')[0]}.speed.csv")] for log in WHEEL]
    tasks += [
        [
            (
                "phase-shift",
                "encoder_ramp.h5",
                "--calibrate",
                "calibration.toml",
                "-o",
                "ramp.phase_shift.csv",
            ),
            (
                "phase-shift",
                "encoder.h5",
                "--calibration",
                "calibration.toml",
                "-o",
                "encoder.phase_shift.csv",
            ),
        ],
        [("phase-shift", "encoder.h5", "-o", "encoder_alone.phase_shift.csv")],
        [("inflation", "inflation.csv.gz", "-o", "inflation.inflation.csv")],
        [
            ("ingest", "drive.csv.gz", "-o", "drive_run.h5"),
            ("footprint", "drive_run.h5", "-o", "run.footprint.csv"),
        ],
    ]
    for name, (carcass, _, _) in QUESTIONS.items():
        asked = commands(name)
        if carcass == "coupled_ring":
            del asked["ladder"]
        tasks.append([new_model(name), *asked.values()])
    with ProcessPoolExecutor(2) as pool:
        parts = list(pool.map(_commands_in, [(folder, lines) for lines in tasks]))
    lines = sorted(line for part in parts for line in part)
    (folder / "statuses.txt").write_text("\n".join(lines) + "\n")


def values(path: Path) -> Iterator[tuple[str, str]]:
    """Every value of a golden with the place where it stands."""
    if path.suffix == ".json":
        yield from _leaves("", json.loads(path.read_text()))
    elif path.suffix == ".csv":
        with path.open(newline="") as stream:
            for number, row in enumerate(csv.DictReader(stream)):
                yield from (
                    (f"row {number} {name}", value)
                    for name, value in row.items()
                    if not name.startswith(LEFT_OUT)
                )
    else:
        yield from ((f"line {n}", line) for n, line in enumerate(path.read_text().splitlines()))


def _leaves(place: str, value: object) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for name, part in value.items():
            if not str(name).startswith(LEFT_OUT):
                yield from _leaves(f"{place}.{name}", part)
    elif isinstance(value, list):
        for number, part in enumerate(value):
            yield from _leaves(f"{place}[{number}]", part)
    else:
        yield place, "" if value is None else str(value)


def same(old: str, new: str, tolerance: tuple[float, float] = TOLERANCE) -> bool:
    """Equal, or numbers within the tolerance."""
    if old == new:
        return True
    try:
        a, b = float(old), float(new)
    except ValueError:
        return False
    return math.isclose(a, b, rel_tol=tolerance[0], abs_tol=tolerance[1]) or (
        math.isnan(a) and math.isnan(b)
    )


def compare(old: Path, new: Path) -> int:
    """Print what differs; how many files do."""
    made = [
        p
        for p in sorted(old.iterdir())
        if p.suffix in (".csv", ".json") or p.name == "statuses.txt" or ".fitted." in p.name
    ]
    made = [p for p in made if ".truth." not in p.name]
    wrong = 0
    for path in made:
        other = new / path.name
        if not other.is_file():
            print(f"{path.name}: missing")
            wrong += 1
            continue
        before, after = dict(values(path)), dict(values(other))
        moved = [k for k in before if k in after and not same(before[k], after[k])]
        gone, added = sorted(set(before) - set(after)), sorted(set(after) - set(before))
        if moved or gone or added:
            wrong += 1
            print(
                f"{path.name}: {len(moved)} of {len(before)} values moved, {len(gone)} gone, "
                f"{len(added)} new"
            )
            for place in moved[:6]:
                print(f"    {place}: {before[place]} -> {after[place]}")
            for place in [*gone[:3], *added[:3]]:
                print(f"    {'gone' if place in before else 'new'}: {place}")
    print(f"{len(made)} goldens, {wrong} differ")
    return wrong


def main() -> int:
    """Write goldens, or compare two folders of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("write").add_argument("folder", type=Path)
    two = verbs.add_parser("compare")
    two.add_argument("old", type=Path)
    two.add_argument("new", type=Path)
    verbs.add_parser("keep").add_argument(
        "names", nargs="*", choices=[[], "errors", "mistakes", *KEPT], metavar="NAME"
    )
    options = parser.parse_args()
    if options.verb == "keep":
        keep(options.names)
        return 0
    if options.verb == "write":
        write(options.folder)
        return 0
    return 1 if compare(options.old, options.new) else 0


if __name__ == "__main__":
    sys.exit(main())
