"""Property: a name is read from its own column or none; units in headers are heeded."""

import h5py
import numpy as np
import pytest

from tests.readers.text_logs import read, setup_of
from tirelog.errors import ReadError
from tirelog.runs.ingest import open_recording, write_run
from tirelog.vocabulary.kinds import KINDS

COLUMNS = {"time": 0.0, "strain": 100.0, "temp": 200.0, "load": 300.0}


def rows(separator=",", front="", behind="", n=300):
    """Each column holds its own hundred, plus the row's number over ten thousand."""
    cells = [[f"{base + i / 10_000:.4f}" for base in COLUMNS.values()] for i in range(n)]
    counted = ([*([str(i + 1)] if front else []), *row] for i, row in enumerate(cells))
    return "".join(separator.join(row) + behind + "\n" for row in counted)


def hundred_of(text, source, log='time = "#1"'):
    """(the hundred of the column that the source reads, remarks)."""
    reader, block = read(text, {"x": source}, log, kind="temperature")
    return float(np.floor(block.values["x"][0] / 100) * 100), reader.report.remarks


#: beside those of `benchmarks/layouts`
HEADERS = {
    "R: row numbers without a name": '"time","strain","temp","load"\n' + rows(front="1"),
    "pandas: a blank name": ",time,strain,temp,load\n" + rows(front="1"),
    "row numbers and separators behind": "time,strain,temp,load,\n" + rows(front="1", behind=","),
    "numpy, mark attached": "#time strain temp load\n" + rows(" "),
    "numpy, commas": "# time,strain,temp,load\n" + rows(),
    "numpy, units below": "# time strain temp load\n# s m/m K N\n" + rows(" "),
    "MATLAB": "% time\tstrain\ttemp\tload\n" + rows("\t"),
    "a mark that names row numbers": "#;time;strain;temp;load\n" + rows(";", front="1"),
}


@pytest.mark.parametrize("what", HEADERS)
@pytest.mark.parametrize("name", ["strain", "temp", "load"])
def test_a_name_reads_its_own_column(what, name):
    first = "#2" if "row numbers" in what or "blank name" in what else "#1"
    found, remarks = hundred_of(HEADERS[what], name, f'time = "{first}"')
    assert found == COLUMNS[name]
    assert ("row number without a name" in " ".join(remarks)) == (what in list(HEADERS)[:3:2])


MISFITS = {
    "a separator missing in front": "timestrain,temp,load\n" + rows(),
    "two separators missing": "time,straintempload\n" + rows(),
    "a separator missing behind a counter that has a name": "no,time,straintemp,load\n"
    + rows(front="1"),
    "a separator missing and separators behind": "time,straintemp,load,\n" + rows(behind=","),
    "numpy, one name missing": "# strain temp load\n" + rows(" "),
}


@pytest.mark.parametrize("what", MISFITS)
def test_a_header_that_does_not_fit_gives_no_names(what):
    for name in ("strain", "temp", "load"):
        with pytest.raises(ReadError, match=rf"no column '{name}' can be identified: .*#1 to"):
            hundred_of(MISFITS[what], name)
    found, remarks = hundred_of(MISFITS[what], "#3")
    assert found == (100.0 if "counter" in what else 200.0)
    assert "names are not used" in " ".join(remarks)


UNITS = {
    "vertical_load": ("FRC-01 [kN]", "kN", "V"),
    "strain": ("DMS_AS [um/m]", "um/m", "N"),
    "radial_acceleration": ("ACC01_z (g)", "g", "kN"),
    "vehicle_speed": ("v [km/h]", "km/h", "K"),
    "temperature": ("T1 (°C)", "degC", "g"),
    "inflation_pressure": ("p [mbar]", "mbar", "m"),
}


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
@pytest.mark.parametrize("kind", UNITS)
def test_the_header_s_unit_is_that_of_a_channel_without_one(kind, encoding):
    header, unit, wrong = UNITS[kind]
    text = f"time_s,{header}\n" + "".join(f"{i / 10},{i % 7}\n" for i in range(60))
    source = header.split(" [")[0].split(" (")[0]

    def taken(text, name=source, **keys):
        reader, _ = read(text.encode(encoding), {"x": name}, kind=kind, **keys)
        return reader.setup.channels["x"].unit, "".join(reader.report.remarks)

    assert taken(text) == taken(text, "#2") == (unit, "")
    own = KINDS[kind].source_unit
    found, said = taken(text, unit=own)
    assert (found, "the setup's is used" in said) == (own, True)
    found, said = taken(text.replace(header, f"{source} [{wrong}]"))
    assert (found, "which is none of" in said) == (None, True)
    assert "'furlong', which is not known" in taken(text.replace(header, f"{source} [furlong]"))[1]


def test_a_unit_row_counts_as_the_header_does():
    text = "t;F\n[s];[kN]\n" + "".join(f"{i / 10};{i % 7}\n" for i in range(60))
    reader, _ = read(text, {"x": "F"}, kind="vertical_load")
    assert reader.setup.channels["x"].unit == "kN"


def test_what_says_the_same_is_not_said():
    text = "t,eps [-],F [N],n [1]\n" + "".join(f"{i / 10},0.1,{i % 7},{i}\n" for i in range(60))
    kinds = {"eps": "strain", "F": "vertical_load", "n": "wheel_encoder"}
    channels = {name: {"kind": kind, "source": name} for name, kind in kinds.items()}
    assert read(text, channels)[0].report.remarks == []


def hdf5_log(path):
    with h5py.File(path, "w") as file:
        file["F"] = np.arange(60.0)
        file["F"].attrs.update(units="kN", sampling_rate_Hz=10.0)


def text_log(path):
    path.write_text("time_s,F [kN]\n" + "".join(f"{i / 10},{i}\n" for i in range(60)))


@pytest.mark.parametrize("write", [hdf5_log, text_log])
@pytest.mark.parametrize("given", [{}, {"unit": "N"}, {"unit": "kN"}])
def test_a_log_and_its_run_have_the_same_values(tmp_path, write, given):
    setup = setup_of({"x": "F"}, kind="longitudinal_force", **given)
    contradicted = given == {"unit": "N"}
    write(tmp_path / "log")
    write_run(str(tmp_path / "log"), setup, tmp_path / "run.h5")
    for path, with_setup in (("log", setup), ("run.h5", None), ("run.h5", setup)):
        with open_recording(str(tmp_path / path), with_setup) as recording:
            values = recording.channels["x"].read()
            assert recording.setup.channels["x"].source_unit == given.get("unit", "kN")
            said = [remark for remark in recording.remarks if "the setup's is used" in remark]
        assert len(said) == contradicted
        np.testing.assert_allclose(values, np.arange(60.0) * (1.0 if contradicted else 1000.0))
