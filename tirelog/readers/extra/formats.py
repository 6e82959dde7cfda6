"""Which formats a library reads, which extra brings it, and what the log is made."""

from __future__ import annotations

import re
from dataclasses import dataclass

#: how a set of a universal file begins: -1 alone, then the number of its kind
_UFF = re.compile(rb"\s{0,80}?(?:^|\n)(?: {4}-1 *\r?\n){1,2} {0,5}\d{1,4}[bB]? *[\r\n\d]")
#: first file of a zip archive that is an office document
_OFFICE = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"mimetype")


@dataclass(frozen=True)
class ExtraFormat:
    """A format that the function `convert` of a module here makes the format `made`.

    `name` in sentences, `library` as it is imported, `package` and `extra` as they are installed.
    """

    name: str
    module: str
    made: str
    library: str
    package: str = ""
    extra: str = ""


FORMATS = {
    "TDMS": ExtraFormat("a LabVIEW TDMS file", "tdms", "HDF5", "nptdms", "npTDMS", "tdms"),
    "Excel": ExtraFormat(
        "an Excel or other office document",
        "excel",
        "",
        "python_calamine",
        "python-calamine",
        "excel",
    ),
    "ROS bag": ExtraFormat("a ROS bag", "bag", "MCAP", "rosbags", "rosbags", "ros"),
    "MDF": ExtraFormat("an MDF measurement", "mdf", "HDF5", "asammdf", "asammdf", "mdf"),
    "UFF": ExtraFormat("a universal file (UFF)", "uff", "HDF5", "pyuff", "pyuff", "uff"),
    "Feather": ExtraFormat("an Arrow or Feather file", "feather", "Parquet", "pyarrow"),
}


def extra_format(head: bytes) -> str:
    """The name of the format in FORMATS, by the first bytes of a log; '' if it is none."""
    for start, name in (
        (b"TDSm", "TDMS"),
        (b"MDF     ", "MDF"),
        (b"UnFinMF ", "MDF"),
        (b"#ROSBAG V", "ROS bag"),
        (b"SQLite format 3\0", "ROS bag"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"),
        (b"ARROW1\0\0", "Feather"),
    ):
        if head.startswith(start):
            return name
    if head.startswith(b"PK\3\4") and head[30:].startswith(_OFFICE):
        return "Excel"
    return "UFF" if _UFF.match(head[:400]) else ""
