"""Property: a name is read from its own column or from none; and what the header says of units is
heeded.
"""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.readers.text_logs import read, setup_of
from tirelog.data.setup import Setup
from tirelog.errors import ReadError
from tirelog.runs.ingest import open_recording, write_run
from tirelog.vocabulary.kinds import KINDS

COLUMNS = {"time": 0.0, "strain": 100.0, "temp": 200.0, "load": 300.0}


def rows(separator: str = ",", front: str = "", behind: str = "", n: int = 300) -> str:
    """Each column holds its own hundred, plus the row's number over ten thousand."""
    cells = [[f"{base + i / 10_000:.4f}" for base in COLUMNS.values()] for i in range(n)]
    counted = ([*([str(i + 1)] if front else []), *row] for i, row in enumerate(cells))
    return "".join(separator.join(row) + behind + "\n" for row in counted)


def hundred_of(text: str, source: str, log: str = 'time = "#1"') -> tuple[float, list[str]]:
    """(the hundred of the column that the source reads, remarks)."""
    reader, block = read(text, setup_of({"x": {"kind": "temperature", "source": source}}, log))
    return float(np.floor(block.values["x"][0] / 100) * 100), reader.report.remarks


HEADERS = {
    "as it should be": "time,strain,temp,load\n" + rows(),
    "R: row numbers without a name": '"time","strain","temp","load"\n' + rows(front="1"),
    "pandas: a blank name": ",time,strain,temp,load\n" + rows(front="1"),
    "row numbers and separators behind": "time,strain,temp,load,\n" + rows(front="1", behind=","),
    "numpy": "# time strain temp load\n" + rows(" "),
    "numpy, mark attached": "#time strain temp load\n" + rows(" "),
    "numpy, commas": "# time,strain,temp,load\n" + rows(),
    "numpy, units below": "# time strain temp load\n# s m/m K N\n" + rows(" "),
    "MATLAB": "% time\tstrain\ttemp\tload\n" + rows("\t"),
    "a mark that names row numbers": "#;time;strain;temp;load\n" + rows(";", front="1"),
    "separators behind rows": "time,strain,temp,load\n" + rows(behind=","),
    "separators behind all": "time,strain,temp,load,\n" + rows(behind=","),
}


@pytest.mark.parametrize("what", HEADERS)
@pytest.mark.parametrize("name", ["strain", "temp", "load"])
def test_a_name_reads_its_own_column(what: str, name: str) -> None:
    first = "#2" if "row numbers" in what or "blank name" in what else "#1"
    found, remarks = hundred_of(HEADERS[what], name, f'time = "{first}"')
    assert found == COLUMNS[name]
    assert ("row number without a name" in " ".join(remarks)) == (what in list(HEADERS)[1:4:2])


MISFITS = {
    "a separator missing": "time,straintemp,load\n" + rows(),
    "a separator missing in front": "timestrain,temp,load\n" + rows(),
    "two separators missing": "time,straintempload\n" + rows(),
    "a separator too many": "time,,strain,temp,load\n" + rows(),
    "a separator too many in front": ",time,strain,temp,load\n" + rows(),
    "a separator missing behind a counter that has a name": "no,time,straintemp,load\n"
    + rows(front="1"),
    "a separator missing and separators behind": "time,straintemp,load,\n" + rows(behind=","),
    "numpy, one name missing": "# strain temp load\n" + rows(" "),
}


@pytest.mark.parametrize("what", MISFITS)
@pytest.mark.parametrize("name", ["strain", "temp", "load"])
def test_a_header_that_does_not_fit_gives_no_names(what: str, name: str) -> None:
    with pytest.raises(ReadError, match=rf"no column '{name}' can be told.*allowed are #1 to #"):
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
def test_the_header_s_unit_is_that_of_a_channel_without_one(kind: str, encoding: str) -> None:
    header, unit, wrong = UNITS[kind]
    text = f"time_s,{header}\n" + "".join(f"{i / 10},{i % 7}\n" for i in range(60))
    source = header.split(" [")[0].split(" (")[0]
    for name in (source, "#2"):
        reader, _ = read(text.encode(encoding), setup_of({"x": {"kind": kind, "source": name}}))
        assert reader.setup.channels["x"].unit == unit
        assert reader.report.remarks == []
    other = setup_of({"x": {"kind": kind, "source": source, "unit": KINDS[kind].source_unit}})
    reader, _ = read(text.encode(encoding), other)
    assert reader.setup.channels["x"].unit == other.channels["x"].unit
    assert "the setup's is used" in reader.report.remarks[0]
    reader, _ = read(
        text.replace(header, f"{source} [{wrong}]"),
        setup_of({"x": {"kind": kind, "source": source}}),
    )
    assert reader.setup.channels["x"].unit is None
    assert "which is none of" in reader.report.remarks[0]
    reader, _ = read(
        text.replace(header, f"{source} [furlong]"),
        setup_of({"x": {"kind": kind, "source": source}}),
    )
    assert "'furlong', which is not known" in reader.report.remarks[0]


def test_a_unit_row_counts_as_the_header_does() -> None:
    text = "t;F\n[s];[kN]\n" + "".join(f"{i / 10};{i % 7}\n" for i in range(60))
    reader, _ = read(text, setup_of({"x": {"kind": "vertical_load", "source": "F"}}))
    assert reader.setup.channels["x"].unit == "kN"


def test_what_says_the_same_is_not_said() -> None:
    text = "t,eps [-],F [N],n [1]\n" + "".join(f"{i / 10},0.1,{i % 7},{i}\n" for i in range(60))
    kinds = {"eps": "strain", "F": "vertical_load", "n": "wheel_encoder"}
    reader, _ = read(
        text, setup_of({name: {"kind": kind, "source": name} for name, kind in kinds.items()})
    )
    assert reader.report.remarks == []


def hdf5_log(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["F"] = np.arange(60.0)
        file["F"].attrs.update(units="kN", sampling_rate_Hz=10.0)


def text_log(path: Path) -> None:
    path.write_text("time_s,F [kN]\n" + "".join(f"{i / 10},{i}\n" for i in range(60)))


@pytest.mark.parametrize("write", [hdf5_log, text_log])
@pytest.mark.parametrize("given", [{}, {"unit": "N"}, {"unit": "kN"}])
def test_a_log_and_its_run_have_the_same_values(
    tmp_path: Path, write: object, given: dict[str, str]
) -> None:
    setup: Setup = setup_of({"x": {"kind": "longitudinal_force", "source": "F", **given}})
    write(tmp_path / "log")  # type: ignore[operator]
    write_run(str(tmp_path / "log"), setup, tmp_path / "run.h5")
    for path, with_setup in (("log", setup), ("run.h5", None), ("run.h5", setup)):
        with open_recording(str(tmp_path / path), with_setup) as recording:
            values = recording.channels["x"].read()
            assert recording.setup.channels["x"].source_unit == given.get("unit", "kN")
            assert any("the setup's is used" in remark for remark in recording.remarks) == (
                given == {"unit": "N"}
            )
        np.testing.assert_allclose(
            values, np.arange(60.0) * (1.0 if given == {"unit": "N"} else 1000.0)
        )
