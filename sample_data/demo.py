"""The main job on the sample logs, command by command: tables, then the tutorial of the hidden
effect. `make demo` runs it.

Everything is written to demo_output/; each command is printed as it could be typed there.
"""

import json
import shlex
import subprocess
import sys
from pathlib import Path

SAMPLES = Path(__file__).resolve().parent
OUTPUT = SAMPLES.parent / "demo_output"
TIRELOG = str(Path(sys.executable).parent / "tirelog")
HIDDEN = ["hidden_1.csv.gz", "hidden_2.csv.gz"]
UNKNOWN = ["unknown_1.csv.gz", "unknown_2.csv.gz"]

#: what `diagnose` says of the unknown logs, "behind the exit edge, ringing at 140 Hz, fixed in
#: time", as a formula of one's own
OWN_EFFECT = r'''
[[effects]]
name = "ring_down"
acts_on = "strain"
expression = """\
    A * (speed / 20) * exp(-abs(xi - L) / speed * rate) \
    * sin(2 * pi * f * (xi - L) / speed) * (xi > L)"""
parameters.A = { value = 1e-5, min = -1e-3, max = 1e-3 }
parameters.rate = { value = 50.0, min = 1.0, max = 500.0 }
parameters.f = { value = 140.0, min = 50.0, max = 300.0 }
'''


def title(text: str) -> None:
    print(f"\n== {text}", flush=True)


def tirelog(*arguments: str, show: int | None = None) -> None:
    """Run a command in the output folder; `show` limits the lines that are shown."""
    print(f"$ tirelog {shlex.join(arguments)}", flush=True)
    done = subprocess.run(
        [TIRELOG, *arguments, *([] if arguments[0] in ("effects", "model") else ["--quiet"])],
        cwd=OUTPUT,
        text=True,
        stdout=subprocess.PIPE,
    )
    lines = done.stdout.splitlines()
    print(
        "\n".join(lines[:show]) + ("\n..." if show is not None and len(lines) > show else ""),
        flush=True,
    )
    if done.returncode:
        sys.exit(f"tirelog ended with status {done.returncode}")


def sample(name: str) -> str:
    return str(Path("..") / "sample_data" / name)


def tables() -> None:
    title("A recorded log becomes tables")
    tirelog("info", sample("drive.csv.gz"))
    tirelog("ingest", sample("drive.csv.gz"), "-o", "drive.h5")
    tirelog("speed", "drive.h5", "-o", "speed.csv")
    tirelog("footprint", "drive.h5", "-o", "footprint.csv", "--plot", "footprint.png")
    tirelog("dissipation", "drive.h5", "-o", "dissipation.csv", "--plot", "dissipation.png")
    title(
        "An encoder and an in-tire accelerometer: learn the speed maps on a slow ramp, apply "
        "them to a drive"
    )
    tirelog(
        "phase-shift",
        sample("encoder_ramp.h5"),
        "--calibrate",
        "calibration.toml",
        "-o",
        "phase_ramp.csv",
    )
    tirelog(
        "phase-shift",
        sample("encoder.h5"),
        "--calibration",
        "calibration.toml",
        "-o",
        "phase.csv",
        "--plot",
        "phase.png",
    )


def hidden() -> None:
    title("A log with a hidden effect: the beam alone does not fit; where?")
    logs = [sample(name) for name in HIDDEN]
    tirelog(
        "model", "new", "--carcass", "beam", "--setup", sample("hidden_1.toml"), "-o", "beam.toml"
    )
    tirelog("compare", *logs, "--model", "beam.toml", "--plot", "beam.png", show=8)
    title("Which effect is missing?")
    tirelog("diagnose", *logs, "--model", "beam.toml", show=6)
    title("Add it, and compare again; or let the ladder do it")
    name = _diagnosed(logs)
    tirelog("model", "add", "beam.toml", name, "-o", "better.toml")
    tirelog("compare", *logs, "--model", "better.toml", "--plot", "better.png", show=8)
    tirelog("ladder", *logs, "--model", "beam.toml", "-o", "ladder.json", "--plot", "ladder.png")
    _reveal(HIDDEN[0])


def _diagnosed(logs: list[str]) -> str:
    """The first effect that `diagnose` names."""
    command = [TIRELOG, "diagnose", *logs, "--model", "beam.toml", "--format", "json", "--quiet"]
    return str(
        json.loads(
            subprocess.run(command, cwd=OUTPUT, text=True, capture_output=True, check=True).stdout
        )["selected"][0]
    )


def unknown() -> None:
    title(
        "An effect that no catalogue has: what remains is described, and becomes an effect of "
        "one's own"
    )
    logs = [sample(name) for name in UNKNOWN]
    tirelog(
        "model", "new", "--carcass", "beam", "--setup", sample("unknown_1.toml"), "-o", "own.toml"
    )
    command = [TIRELOG, "diagnose", *logs, "--model", "own.toml", "--quiet"]
    said = subprocess.run(
        command, cwd=OUTPUT, text=True, capture_output=True, check=True
    ).stdout.splitlines()
    print(f"$ tirelog diagnose {' '.join(logs)} --model own.toml")
    print("\n".join([*said[:2], *(line for line in said if line.startswith("What remains"))]))
    with (OUTPUT / "own.toml").open("a") as model:
        model.write(OWN_EFFECT)
    print("own.toml += " + OWN_EFFECT)
    tirelog("compare", *logs, "--model", "own.toml", "--plot", "own.png", show=4)
    _reveal(UNKNOWN[0])


def _reveal(log: str) -> None:
    planted = json.loads((SAMPLES / f"{log}.truth.json").read_text())["effects"]
    print(f"The truth of {log}: {json.dumps(planted)}")


def main() -> None:
    OUTPUT.mkdir(exist_ok=True)
    tables()
    hidden()
    unknown()
    title("One page to send to a colleague")
    logs = [sample(name) for name in HIDDEN]
    known = ["--model", "beam.toml", "--ladder", "ladder.json"]
    tirelog("report", *logs, *known, "-o", "report.html")
    print(f"\nWritten to {OUTPUT.name}/:")
    print("  report.html                       open it in a browser: it needs nothing else")
    print("  speed, footprint, dissipation, phase .csv and .png")
    print(
        "  beam.png, better.png, own.png     model against measurement: before, after, with an "
        "effect of one's own"
    )
    print("  ladder.png                        the error falling to the noise floor")


if __name__ == "__main__":
    main()
