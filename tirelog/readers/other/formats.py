"""What a file is, by its first bytes; of what is not read, the one line that converts it."""

from __future__ import annotations

from tirelog.errors import ReadError

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
PARQUET_MAGIC = b"PAR1"
#: bytes by which a format is told: magic numbers stand at the start
HEAD_BYTES = 4096

_PYTHON = 'python -c "from {library}; {call}" (pip install {package})'
_TDMS = _PYTHON.format(
    library="nptdms import TdmsFile", call="TdmsFile('FILE').as_hdf('log.h5')", package="npTDMS"
)
_FEATHER = "python -c \"import pandas; pandas.read_feather('FILE').to_parquet('log.parquet')\""
_NUMPY = "python -c \"import numpy; numpy.savetxt('log.txt', numpy.load('FILE'))\""
_MCAP = "mcap convert FILE log.mcap"
_OFFICE = "save it as csv from there"
#: first bytes -> (name, how to make of it what is read)
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"TDSm", "a LabVIEW TDMS file", _TDMS),
    (b"MDF     ", "an MDF measurement", "export it as csv or mat, by asammdf or the logger's own"),
    (b"UnFinMF", "an unfinished MDF measurement", "finish it with the logger's own program"),
    (b"#ROSBAG V", "a ROS 1 bag", _MCAP),
    (b"SQLite format 3\0", "an SQLite database (a ROS 2 bag?)", _MCAP),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel or other office document", _OFFICE),
    (b"ARROW1\0\0", "an Arrow or Feather file", _FEATHER),
    (b"\x93NUMPY", "a numpy array", _NUMPY),
    (b"LOGG\x90\0\0\0", "a CAN log of Vector (.blf)", "export it as csv or mat"),
    (b"\x80\x04\x95", "a Python pickle, which is never opened", "save it as csv or HDF5"),
    (b"BZh91AY&SY", "compressed by bzip2", "bunzip2 FILE"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-zip archive", "7z x FILE"),
    (b"Rar!\x1a\x07", "a RAR archive", "unrar x FILE"),
)
#: first file of a zip archive that is no log -> (what it is, the one line that converts it)
_ZIPPED: tuple[tuple[bytes, str, str], ...] = (
    (b"[Content_Types].xml", "an Excel or other office document", _OFFICE),
    (b"_rels/", "an Excel or other office document", _OFFICE),
    (b"mimetype", "an OpenDocument file", _OFFICE),
)


def is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == HDF5_MAGIC for at in (0, 512, 1024, 2048))


def is_matlab(head: bytes) -> bool:
    """True for MATLAB 5 to 7.2; 7.3 is HDF5."""
    return len(head) >= 128 and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def is_wav(head: bytes) -> bool:
    return head[:4] in (b"RIFF", b"RF64", b"BW64") and head[8:12] == b"WAVE"


def name_of(head: bytes) -> str:
    """HDF5, MCAP, ... or '' for a log of text."""
    tests = {
        "HDF5": is_hdf5(head),
        "MATLAB": is_matlab(head),
        "Parquet": head.startswith(PARQUET_MAGIC),
        "WAV": is_wav(head),
        "MCAP": head.startswith(MCAP_MAGIC),
    }
    return next((name for name, found in tests.items() if found), "")


def refuse_foreign(head: bytes, log: str) -> None:
    """ReadError: a format that is known and not read."""
    zipped = _ZIPPED if head.startswith(b"PK\3\4") else ()
    for starts, told in ((head, _FOREIGN), (head[30:], zipped)):
        found = next((one for one in told if starts.startswith(one[0])), None)
        if found is not None:
            raise ReadError(
                f"is {found[1]}",
                allowed="read are text, MCAP, HDF5, MATLAB, Parquet and WAV",
                do=f"convert it first: {found[2]}",
                file=log,
            )
