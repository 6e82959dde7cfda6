"""What a file is, by its first bytes; of what is not read, the one line that converts it."""

from __future__ import annotations

from tirelog.errors import ReadError
from tirelog.readers.extra.formats import FORMATS, extra_format

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
PARQUET_MAGIC = b"PAR1"
#: bytes by which a format is told: magic numbers stand at the start
HEAD_BYTES = 4096

#: columns are the longer axis, and fields of records have names
_NUMPY = (
    "python -c \"import numpy, pandas; a = numpy.load('FILE'); "
    "a = a.T if a.ndim == 2 and len(a) < a.shape[1] else a; "
    "pandas.DataFrame(a).to_csv('log.csv', index=False, header=bool(a.dtype.names))\""
)
#: first bytes -> (name, how to make of it what is read)
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"\x93NUMPY", "a numpy array", _NUMPY),
    (b"LOGG\x90\0\0\0", "a CAN log of Vector (.blf)", "export it as csv or mat"),
    (b"\x80\x04\x95", "a Python pickle, which is never opened", "save it as csv or HDF5"),
    (b"BZh91AY&SY", "compressed by bzip2", "bunzip2 -k FILE"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-zip archive", "7z x FILE"),
    (b"Rar!\x1a\x07", "a RAR archive", "unrar x FILE"),
)


def is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == HDF5_MAGIC for at in (0, 512, 1024, 2048))


def is_matlab(head: bytes) -> bool:
    """True for MATLAB 5 to 7.2; 7.3 is HDF5."""
    return len(head) >= 128 and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def is_wav(head: bytes) -> bool:
    return head[:4] in (b"RIFF", b"RF64", b"BW64") and head[8:12] == b"WAVE"


def name_of(head: bytes) -> str:
    """HDF5, MCAP, ..., a name of `FORMATS`, or '' for a log of text."""
    tests = {
        "HDF5": is_hdf5(head),
        "MATLAB": is_matlab(head),
        "Parquet": head.startswith(PARQUET_MAGIC),
        "WAV": is_wav(head),
        "MCAP": head.startswith(MCAP_MAGIC),
    }
    return next((name for name, found in tests.items() if found), "") or extra_format(head)


def refuse_foreign(head: bytes, log: str) -> None:
    """ReadError: a format that is known and not read."""
    found = next((one for one in _FOREIGN if head.startswith(one[0])), None)
    if found is not None:
        with_extras = ", ".join(name for name, one in FORMATS.items() if one.extra)
        raise ReadError(
            f"is {found[1]}",
            allowed="read are text, MCAP, HDF5, MATLAB, Parquet, Feather and WAV, and with an "
            f"extra {with_extras}",
            do=f"convert it first: {found[2]}",
            file=log,
        )
