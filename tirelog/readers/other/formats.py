"""What a file is, by its first bytes; of what is not read, the one line that converts it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tirelog.errors import ReadError

#: bytes by which a format is known: magic numbers are at the start
HEAD_BYTES = 4096


@dataclass(frozen=True)
class ConvertedFormat:
    """A format that `convert_MODULE` in `datasets` makes the format `made` ('' for text).

    `start` is a regular expression of its first bytes, `name` its name in sentences. `library` is
    the module that reads it, `package` and `extra` are the names that install it. `imports` are
    loaded before the limits are set, if not the library alone.
    """

    start: bytes
    name: str
    module: str
    made: str
    library: str
    package: str = ""
    extra: str = ""
    imports: tuple[str, ...] = ()


FORMATS = {
    "MATLAB": ConvertedFormat(  # 5 to 7.2; 7.3 is HDF5
        rb".{124}(\x00\x01IM|\x01\x00MI)",
        "a MATLAB file",
        "matlab",
        "HDF5",
        "scipy",
        imports=("scipy.io",),
    ),
    "Parquet": ConvertedFormat(
        rb"PAR1", "a Parquet file", "arrow", "", "pyarrow", imports=("pyarrow.parquet",)
    ),
    "Feather": ConvertedFormat(
        rb"ARROW1\x00\x00",
        "an Arrow or Feather file",
        "arrow",
        "",
        "pyarrow",
        imports=("pyarrow.ipc",),
    ),
    "WAV": ConvertedFormat(
        rb"(RIFF|RF64|BW64).{4}WAVE",
        "a WAV recording",
        "wav",
        "HDF5",
        "scipy",
        imports=("scipy.io.wavfile",),
    ),
    "TDMS": ConvertedFormat(
        rb"TDSm", "a LabVIEW TDMS file", "tdms", "HDF5", "nptdms", "npTDMS", "tdms"
    ),
    "Excel": ConvertedFormat(  # of before 2007, or a zip archive whose first file is of an office's
        rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
        rb"|PK\x03\x04.{26}(\[Content_Types\]\.xml|_rels/|docProps/|xl/|mimetype)",
        "an Excel or other office document",
        "excel",
        "",
        "python_calamine",
        "python-calamine",
        "excel",
    ),
    "zip": ConvertedFormat(rb"PK\x03\x04", "a zip archive", "zip", "", "zipfile"),
    "MDF": ConvertedFormat(
        rb"MDF     |UnFinMF ", "an MDF measurement", "mdf", "HDF5", "asammdf", "asammdf", "mdf"
    ),
}
#: format -> a regular expression of its first bytes, of all that are read and no text
_STARTS = {
    "HDF5": rb"(.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n",
    "MCAP": rb"\x89MCAP0\r\n",
} | {name: one.start for name, one in FORMATS.items()}

#: columns are the longer axis, and fields of records have names
_NUMPY = (
    "python -c \"import numpy, pandas; a = numpy.load('FILE'); "
    "a = a.T if a.ndim == 2 and len(a) < a.shape[1] else a; "
    "pandas.DataFrame(a).to_csv('log.csv', index=False, header=bool(a.dtype.names))\""
)
_TO_MCAP = "rosbags-convert --src FILE --dst log --dst-storage mcap"
#: (a regular expression of the first bytes, name, how to make of it what is read)
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"\x93NUMPY", "a numpy array", _NUMPY),
    (b"LOGG\x90\0\0\0", "a CAN log of Vector (.blf)", "export it as csv or mat"),
    (b"[|]CF,", "a measurement of imc", "export it as csv, mat or tdms"),
    (b"\x94\x13", "a binary file of catman", "export it as ASCII or MATLAB"),
    (b"MULTI_STREAM_FIL", "a measurement of Dewesoft", "export it as csv, mat or mdf"),
    (b"<hCNF", "a log of AiM (.xrk)", "export it from Race Studio as csv"),
    (b"@\0\0\0\0\0\0\0", "a log of MoTeC (.ld)", "export it from i2 as csv or mat"),
    (b"MLVLG\0", "a log of MegaLogViewer (.mlg)", "export it as csv"),
    (b"\xd7\0\0\0lf3", "a log of Link (.llg)", "export it from PCLink as csv"),
    (b"ULog\x01\x12\x35", "a log of PX4 (.ulg)", "ulog2csv FILE"),
    (b"\xa3\x95\x80", "a log of ArduPilot (.bin)", "mavlogdump.py --format csv --types IMU FILE"),
    (b"#ROSBAG V", "a ROS bag", _TO_MCAP),
    (b"SQLite format 3\0", "a database, as a ROS bag is", _TO_MCAP),
    (  # a set begins with -1 alone, then the number of its kind
        rb"\s{0,80}?(?:^|\n)(?: {4}-1 *\r?\n){1,2} {0,5}\d{1,4}[bB]? *[\r\n\d]",
        "a universal file (UFF)",
        "export it as csv or mat",
    ),
    (b"CDF\x01", "a classic netCDF file", "nccopy -k netCDF-4 FILE log.nc"),
    (b"CDF\x02", "a classic netCDF file", "nccopy -k netCDF-4 FILE log.nc"),
    (b"\xd4\xc3\xb2\xa1", "a capture of a network (.pcap)", "export its signals as csv"),
    (b"\x0a\x0d\x0d\x0a", "a capture of a network (.pcapng)", "export its signals as csv"),
    (b"\x04\x22\x4d\x18", "compressed by lz4", "lz4 -d FILE"),
    (b"\x1a\x45\xdf\xa3", "a recording of enDAQ (.ide) or another EBML file", "export it as csv"),
    (b"\x80\x04\x95", "a Python pickle, which is never opened", "save it as csv or HDF5"),
    (b"BZh91AY&SY", "compressed by bzip2", "bunzip2 -k FILE"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-zip archive", "7z x FILE"),
    (b"Rar!\x1a\x07", "a RAR archive", "unrar x FILE"),
)


def name_of(head: bytes) -> str:
    """HDF5, MCAP, a name of `FORMATS`, or '' for a log of text."""
    names = (name for name, start in _STARTS.items() if re.match(start, head, re.DOTALL))
    return next(names, "")


def refuse_foreign(head: bytes, log: str) -> None:
    """ReadError: a format that is known and not read."""
    found = next((one for one in _FOREIGN if re.match(one[0], head)), None)
    if found is not None:
        with_extras = ", ".join(name for name, one in FORMATS.items() if one.extra)
        raise ReadError(
            f"is {found[1]}",
            allowed="read are text, MCAP, HDF5, MATLAB, Parquet, Feather and WAV, and with an "
            f"extra {with_extras}",
            do=f"convert it first: {found[2]}",
            file=log,
        )
