"""The series of a log of any format."""

from __future__ import annotations

from pathlib import Path

from tirelog.readers.series import Listed


def listed(format: str, path: Path, log: str) -> Listed:
    """The series of the file at `path`, the log or what was made of it; `log` its name.

    ReadError: nothing in it can be read.
    """
    if format == "HDF5":
        from tirelog.readers.hdf5.series import datasets

        return datasets(path, log)
    if format == "MCAP":
        from tirelog.readers.mcap.series import fields

        return fields(path, log)
    if format == "WAV":
        from tirelog.readers.other.wav import channels

        return channels(path, log)
    if format == "Parquet":
        from tirelog.readers.other.parquet import text_of
        from tirelog.readers.text.series import columns

        return columns(text_of(path, log)[0], log)
    from tirelog.readers.text.series import columns
    from tirelog.readers.text.source import ByteSource

    return columns(ByteSource(path, log), log)
