"""Property: a log, its run, standard input and compressed copies give the same rows."""

import gzip
import hashlib
import io
import json
import lzma
import subprocess
import sys

import pandas as pd
import pyarrow.parquet as pq
import pytest
import zstandard

COMPRESS = {
    "gz": gzip.compress,
    "xz": lzma.compress,
    "zst": lambda data: zstandard.ZstdCompressor().compress(data),
}


def frame(text):
    return pd.read_csv(io.StringIO(text)).drop(columns="log")


@pytest.mark.parametrize("suffix", COMPRESS)
def test_compressed_logs_give_the_same_rows(folder, tirelog, suffix):
    (folder / f"log.csv.{suffix}").write_bytes(COMPRESS[suffix]((folder / "log.csv").read_bytes()))
    pd.testing.assert_frame_equal(
        frame(tirelog("speed", f"log.csv.{suffix}").out),
        frame(tirelog("speed", "log.csv").out),
        check_exact=True,
    )


def test_a_run_and_standard_input_give_the_same_rows(folder, tirelog):
    want = tirelog("speed", "log.csv")
    assert tirelog("ingest", "log.csv", "-o", "run.h5").status == 0
    pd.testing.assert_frame_equal(
        frame(tirelog("speed", "run.h5").out), frame(want.out), check_exact=True
    )
    with open("log.csv", "rb") as stream:
        piped = subprocess.run(
            [sys.executable, "-m", "tirelog", "speed", "-", "--setup", "log.toml"],
            stdin=stream,
            capture_output=True,
            check=True,
        )
    pd.testing.assert_frame_equal(frame(piped.stdout.decode()), frame(want.out), check_exact=True)


@pytest.mark.parametrize("name", ["t.csv", "t.parquet", "t.ndjson", "t.json"])
def test_every_format_of_one_table_passes_check(folder, tirelog, name):
    assert tirelog("speed", "log.csv", "-o", name).status == 0
    assert tirelog("speed", "log.csv", "-o", "want.csv").status == 0
    assert tirelog("check", name, "--against", "want.csv").status == 0


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (["speed", "-o", "t.parquet"], "t.parquet"),
        (["tables", "--table", "speed", "-o", "f", "--format", "parquet"], "f/speed.parquet"),
    ],
)
def test_a_parquet_table_and_a_run_carry_the_hash_of_the_log(folder, tirelog, command, name):
    digest = hashlib.sha256((folder / "log.csv").read_bytes()).hexdigest()
    assert tirelog("ingest", "log.csv", "-o", "run.h5").status == 0
    for log in ("log.csv", "run.h5"):
        assert tirelog(command[0], log, *command[1:]).status == 0
        assert json.loads(pq.read_schema(name).metadata[b"tirelog"])["inputs"] == {log: digest}
    assert digest[:12] in tirelog("info", "log.csv").out


def test_info_as_a_table(folder, tirelog):
    rows = json.loads(tirelog("info", "log.csv", "--format", "json").out)
    assert [(r["channel"], r["samples"], r["rate_Hz"]) for r in rows] == [
        ("strain_1", 10000, 2500.0),
        ("temp_1", 10000, 2500.0),
    ]
