"""Property: every command that tirelog prints anywhere is taken, and runs on sample_data."""

import gzip
import html
import re
import shlex
import shutil
import sys
from io import BufferedReader, BytesIO, TextIOWrapper
from itertools import islice
from pathlib import Path

import pytest

from tests.cli.conftest import command_of, refuse_other_options, tirelog
from tests.test_words import held
from tirelog.cli import run
from tirelog.cli.app import EXAMPLES

__all__ = ["tirelog"]

pytestmark = pytest.mark.xdist_group("printed commands")  # one worker makes what these tests share

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_data"
#: lines of the logs of 40 s that are kept: eight manoeuvres of both together and more
_LINES = 50_000
CUT = ("hidden_1", "hidden_2")
#: what the help's examples name and sample_data does not hold: the commands that make it
MADE = (
    "speed drive.csv.gz -o golden.csv",
    "speed drive.csv.gz -o speed.csv",
    "model new --setup drive.toml -o model.toml",
    "model new --preset P3 -o ring.toml",
    "model new --setup drive.toml -o fitted.toml",
    "model add model.toml water_film -o better.toml",
    "model add ring.toml hysteresis --set loss_factor=0.2 -o lossy.toml",
)
SCENARIO = """seed = 1
truth = "beam"
[[manoeuvres]]
duration_s = 2
speed_m_s = 12
[channels.strain_1]
kind = "fbg_strain"
source = "CH1_FBG1"
angle_deg = 150.0
reference_wavelength_nm = 1550.0
noise = 0.0008
"""
CAMPAIGN = """[campaign]
name = "two"
output = "campaign"
[[logs]]
glob = "hidden_*.csv.gz"
[tables.speed]
"""
#: examples of these take ten seconds and more
SLOW = ("diagnose", "ladder", "propose", "report")


@pytest.fixture(scope="session")
def samples(tmp_path_factory):
    """A copy of sample_data, logs of many manoeuvres cut, with what examples name besides."""
    folder = tmp_path_factory.mktemp("printed") / "sample_data"
    shutil.copytree(SAMPLES, folder)
    for name in CUT:
        with gzip.open(SAMPLES / f"{name}.csv.gz") as whole:
            begin = b"".join(islice(whole, _LINES))
        (folder / f"{name}.csv.gz").write_bytes(gzip.compress(begin, compresslevel=1))
    (folder / "log.csv").write_bytes(gzip.decompress((SAMPLES / "drive.csv.gz").read_bytes()))
    (folder / "scenarios" / "drive.toml").write_text(SCENARIO)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "mat.csv").write_text("1,2\n2,4\n3,5\n3,5\n2,4\n1,2\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in MADE:
            assert run([*line.split(), "--quiet"]) == 0, line
    return folder


@pytest.fixture
def folder(samples, monkeypatch):
    monkeypatch.chdir(samples)
    return samples


def commands_in(line):
    """The tirelog commands of a line that a shell would take, with its patterns of files."""
    found = []
    for part in re.split(r"\||&&", line):
        words = shlex.split(part)
        if words[0] == "tirelog":
            files = [sorted(map(str, Path().glob(w))) if "*" in w else [w] for w in words[1:]]
            found.append([name for names in files for name in names])
    return found


def run_all(tirelog, line):
    """What the commands of a line print, each with status 0."""
    said = ""
    for words in commands_in(line):
        outcome = tirelog(*words).ended(0)
        said = outcome.out + outcome.err
    return said


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=pytest.mark.slow) if p in SLOW else p for p in EXAMPLES]
)
def test_examples_in_help_run(folder, tirelog, monkeypatch, path):
    shown = tirelog(*path.split(), "--help").out
    for line, _ in EXAMPLES[path]:
        assert line in shown
        if line.startswith("zstd -dc log.csv.zst"):
            plain = BytesIO((folder / "log.csv").read_bytes())
            monkeypatch.setattr(sys, "stdin", TextIOWrapper(BufferedReader(plain)))
        if "--ladder ladder.json" in line:  # what the example of `ladder` writes
            run_all(tirelog, EXAMPLES["ladder"][0][0])
        run_all(tirelog, line)


# ---- what to do next -----------------------------------------------------------------------------


def printed(text):
    """The commands in what a command printed: a page, a note, a comment of a setup."""
    found = re.findall(r"`(tirelog [^`\n]+)`", text)
    rest = re.sub(r"`[^`\n]*`", "", text)
    for line in rest.splitlines():
        for part in re.findall(r"(?:^\s*|next: |or )(tirelog [a-z].*?)(?=, or tirelog|$)", line):
            found.append(part.strip())
    return found


def with_files(line, **files):
    """The line with names of files in place of the words in capitals."""
    for word, name in files.items():
        line = re.sub(rf"\b{word}\b(?:\.\.\.)?", name, line)
    return line


def test_a_log_without_a_setup_leads_to_one(folder, tirelog):
    (folder / "own logs").mkdir(exist_ok=True)
    shutil.copy(folder / "log.csv", folder / "own logs" / "my log.csv")
    for log, setup in (("log.csv", "log.toml"), ("own logs/my log.csv", "own logs/my log.toml")):
        Path(setup).unlink(missing_ok=True)
        (draft,) = printed(tirelog("info", log).out)
        assert draft == shlex.join(["tirelog", "setup", "new", log, "-o", setup])
        said = run_all(tirelog, draft)
        in_draft = [c for c in printed(Path(setup).read_text()) if "check" in c]
        for check in (*printed(said), *in_draft):
            assert "setup check" in check
            outcome = tirelog(*shlex.split(check)[1:])
            assert "guessed" in outcome.out, outcome.err
    elsewhere = run_all(tirelog, "tirelog setup new log.csv -o drafted.toml")
    Path("log.toml").unlink()
    checks = [*printed(elsewhere), *printed(Path("drafted.toml").read_text())]
    for check in (line for line in checks if "setup check" in line):
        assert "guessed" in tirelog(*shlex.split(check)[1:]).out


def test_a_new_model_is_fitted_and_compared(folder, tirelog):
    said = run_all(tirelog, "tirelog model new --setup hidden_1.toml -o 'my beam.toml'")
    lines = printed(said)
    assert [line.split()[1] for line in lines] == ["model", "compare"]
    for line in lines:
        run_all(tirelog, with_files(line, LOG="hidden_1.csv.gz"))


def next_of(tirelog, line):
    (follows,) = re.findall(r"^(?:tirelog: )?next: (.*)$", run_all(tirelog, line), re.M)
    return str(follows)


def test_tables_lead_to_a_report_with_the_same_setup(folder, tirelog):
    shutil.copy(folder / "drive.csv.gz", folder / "my drive.csv.gz")
    line = "tirelog tables 'my drive.csv.gz' --setup drive.toml -o made --table speed"
    follows = next_of(tirelog, line)
    assert follows == ("tirelog report 'my drive.csv.gz' --setup drive.toml -o made/report.html")
    run_all(tirelog, follows)
    assert (folder / "made" / "report.html").is_file()
    assert "next" not in run_all(tirelog, f"{line} --quiet")


def test_a_comparison_leads_to_a_diagnosis_with_the_same_options(folder, tirelog):
    run_all(tirelog, "tirelog model new --setup hidden_1.toml -o beam.toml")
    shutil.copy(folder / "hidden_1.csv.gz", folder / "first.csv.gz")
    given = "--setup hidden_1.toml --model beam.toml --channel strain_1"
    follows = next_of(tirelog, f"tirelog compare first.csv.gz {given}")
    assert follows == f"tirelog diagnose first.csv.gz {given}"
    run_all(tirelog, follows)
    assert "next" not in run_all(tirelog, f"tirelog compare first.csv.gz {given} --quiet")


def test_too_few_manoeuvres_ask_for_more_with_the_same_options(folder, tirelog):
    run_all(tirelog, "tirelog model new --setup hidden_1.toml -o beam.toml")
    shutil.copy(folder / "hidden_1.csv.gz", folder / "first.csv.gz")
    given = "--setup hidden_1.toml --channel strain_1"
    follows = next_of(tirelog, f"tirelog diagnose first.csv.gz --model beam.toml {given}")
    assert follows == f"tirelog diagnose first.csv.gz MORE_LOGS --model beam.toml {given}"
    typed = with_files(follows, MORE_LOGS="hidden_2.csv.gz")
    run_all(tirelog, typed.replace("diagnose", "compare"))  # as quick as its options can be asked


@pytest.mark.slow
def test_what_is_missing_is_added_and_fitted(folder, tirelog):
    run_all(tirelog, "tirelog model new --setup hidden_1.toml -o beam.toml")
    follows = next_of(tirelog, "tirelog diagnose hidden_1.csv.gz hidden_2.csv.gz --model beam.toml")
    run_all(tirelog, follows)
    fitted = Path("beam+water_film.toml")
    assert "se = " in fitted.read_text() or "+-" in fitted.read_text()
    again = next_of(tirelog, f"tirelog diagnose hidden_1.csv.gz hidden_2.csv.gz --model {fitted}")
    run_all(tirelog, again)


@pytest.mark.slow
def test_what_is_unknown_is_proposed_and_compared(folder, tirelog):
    run_all(tirelog, "tirelog model new --setup unknown_1.toml -o plain.toml")
    logs = "unknown_1.csv.gz unknown_2.csv.gz"
    follows = next_of(tirelog, f"tirelog diagnose {logs} --model plain.toml")
    assert follows.startswith("tirelog propose")
    run_all(tirelog, next_of(tirelog, follows))


# ---- the report page -----------------------------------------------------------------------------


def page_commands(page):
    """Every command on a page, once."""
    codes = re.findall(r"<code>(tirelog .*?)</code>", page.read_text(), re.S)
    lines = (line for code in codes for line in html.unescape(code).splitlines())
    return list(dict.fromkeys(line for line in lines if line.startswith("tirelog ")))


def test_commands_on_a_page_without_a_model_run(folder, tirelog):
    run_all(tirelog, "tirelog report drive.csv.gz -o page.html --quiet")
    lines = page_commands(folder / "page.html")
    assert len(lines) >= 7
    made = [line for line in lines if "-o M.toml" in line]
    assert made == ["tirelog model new --carcass beam --setup drive.toml -o M.toml"]
    run_all(tirelog, made[0])
    for line in lines:
        if line.split()[1] not in ("report", "ladder"):
            run_all(tirelog, line.replace("--model M", "--model M.toml"))


@pytest.mark.slow
def test_commands_on_a_page_with_a_model_run(folder, tirelog):
    run_all(tirelog, "tirelog model new --setup hidden_1.toml -o paged.toml")
    made = "tirelog report hidden_1.csv.gz hidden_2.csv.gz --model paged.toml -o page.html --quiet"
    run_all(tirelog, made)
    lines = page_commands(folder / "page.html")
    assert len(lines) >= 7
    for line in lines:
        if "CALIBRATION.toml" not in line:
            run_all(tirelog, line)


# ---- in messages ---------------------------------------------------------------------------------


def test_every_command_in_a_message_exists():
    """It may lack arguments; its name and its options are there."""
    found = 0
    for file, _, text, documents in held():
        if documents:
            continue
        for line in re.findall(r"(?:^|`)tirelog ([a-z][\w-]*(?: [^`;\n]*)?)(?:`|$|;)", text):
            one, words = command_of(line.split("&&")[0].split())
            if hasattr(one, "commands") and words[:1] == ["X"]:  # a value names the command
                continue
            assert not hasattr(one, "commands"), (file, line)
            refuse_other_options(one, " ".join(words))
            found += 1
    assert found > 20
