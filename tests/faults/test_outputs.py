"""Faults: what has an output's name already, names that others plant, what the killed have left."""

import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tirelog.cli import run
from tirelog.errors import OutputError, UsageError
from tirelog.storage.whole import (
    all_or_none,
    inputs_kept,
    part_name,
    taken_as_input,
    temporary_folder,
    whole_file,
)

#: writes half of t.csv and of a temporary run, and is killed
KILLED = """
import os, signal, sys
from tirelog.storage.whole import temporary_folder, whole_file
with whole_file(sys.argv[1]) as part, temporary_folder() as folder:
    part.write_text("half")
    (folder / "run.h5").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def killed(output, temporary):
    """A process that died while it wrote `output` and had its temporary files in `temporary`."""
    environment = {**os.environ, "TMPDIR": str(temporary)}
    subprocess.run([sys.executable, "-c", KILLED, str(output)], env=environment, check=False)


@pytest.mark.parametrize("size", [244, 250, 255])
def test_a_name_as_long_as_the_system_allows(tmp_path, size):
    for name in ("x" * (size - 4) + ".csv", "é" * ((size - 4) // 2) + ".csv"):
        with whole_file(tmp_path / name) as part:
            part.write_text("1")
        assert (tmp_path / name).read_text() == "1"


def test_the_temporary_name_is_new_each_time_and_a_planted_link_is_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("untouched")
    (tmp_path / f".t.csv.{os.getpid()}.part").symlink_to(victim)  # the name that was chosen once
    assert part_name(tmp_path / "t.csv") != part_name(tmp_path / "t.csv")
    with whole_file(tmp_path / "t.csv") as part:
        part.write_text("1")
    assert victim.read_text() == "untouched"


def test_what_a_killed_process_left_is_swept_and_nothing_else(tmp_path, monkeypatch):
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    killed(tmp_path / "t.csv", temporary)
    left = list(tmp_path.glob(".t.csv.*.part"))
    assert len(left) == 1
    assert len(list(temporary.iterdir())) == 1
    others = [".download.part", ".t.csv.4711.part", ".x.csv.zz-1-1.part", part_name("t.csv").name]
    # another machine's: nobody here knows its processes
    others.append(".t.csv.00000000-" + left[0].name.split("-", 1)[1])
    for name in others:
        (tmp_path / name).write_text("another program's")
    (temporary / "tirelog-abcdefgh").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    with whole_file(tmp_path / "new.csv") as part, temporary_folder():
        part.write_text("1")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*others, "new.csv", "tmp"])
    assert [p.name for p in temporary.iterdir()] == ["tirelog-abcdefgh"]


def test_the_mode_of_an_older_file_is_kept(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("older")
    path.chmod(0o640)
    with whole_file(path) as part:
        part.write_text("1")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_pipe_is_written_through(tmp_path):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    with whole_file(pipe) as part:
        part.write_bytes(b"1" * 300_000)
    reader.join(10)
    assert got == [b"1" * 300_000]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def device(path, minor):
    """An own device of the memory driver's (3 is null, 7 is full), not the machine's."""
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, minor))
        path.open("wb").close()
    except OSError:
        pytest.skip("no right to make devices here")
    return path


def test_a_device_is_written_through(tmp_path):
    null, full = device(tmp_path / "null", 3), device(tmp_path / "full", 7)
    with whole_file(null) as part:
        part.write_text("1")
    assert stat.S_ISCHR(null.stat().st_mode)
    assert null.read_bytes() == b""
    with pytest.raises(OutputError, match="disk is full"), whole_file(full) as part:
        part.write_text("1")


def test_an_input_that_is_met_on_the_way_is_no_output(tmp_path):
    setup = tmp_path / "log.toml"
    setup.write_text("a setup")
    with inputs_kept(), pytest.raises(UsageError), whole_file(setup) as part:
        part.write_text("1")
        taken_as_input(setup)
    assert setup.read_text() == "a setup"
    assert list(tmp_path.iterdir()) == [setup]


def test_several_files_take_their_names_together(tmp_path):
    (tmp_path / "a.csv").write_text("older")

    def write(fail):
        with all_or_none():
            for name in ("a.csv", "b.csv"):
                with whole_file(tmp_path / name) as part:
                    part.write_text("new")
            if fail:
                raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write(fail=True)
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.csv": "older"}
    write(fail=False)
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.csv": "new", "b.csv": "new"}


LOG = Path(__file__).parents[2] / "sample_data" / "drive.csv.gz"
#: begins an output of its argument's name, and then waits
BEGUN = """
import sys, time
from tirelog.storage.whole import whole_file
with whole_file(sys.argv[1]):
    print("begun", flush=True)
    time.sleep(600.0)
"""


def begun(output):
    """A process that has begun an output."""
    command = [sys.executable, "-c", BEGUN, str(output)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    assert list(output.parent.glob(".*.part"))
    return process


def ended(process):
    process.kill()
    process.communicate()


def test_a_later_command_of_one_process_sweeps_its_folder_anew(tmp_path):
    """What a living process has begun stays until it ends."""
    words = ["tables", str(LOG), "-o", str(tmp_path), "--table", "speed", "--quiet"]
    assert run(words) == 0
    other = begun(tmp_path / "footprint.csv")
    try:
        assert run(words) == 0
        assert len(list(tmp_path.glob(".*.part"))) == 1
    finally:
        ended(other)
    assert run(words) == 0
    assert list(tmp_path.glob(".*.part")) == []
