"""Small logs in the formats that a library reads, written by that library or by hand."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

Columns = Mapping[str, NDArray]
#: 2026-03-04 04:53:20 UTC
START_NS = 1_772_600_000_000_000_000
_START = np.datetime64("2026-03-04T04:53:20", "us")


def tdms(path: Path, columns: Columns, rate_Hz: float, segments: int = 3, unit: str = "K") -> None:
    """Waveforms of the group `run`, in segments as a recorder writes them."""
    from nptdms import ChannelObject, TdmsWriter

    about = {"wf_increment": 1.0 / rate_Hz, "wf_start_time": _START, "unit_string": unit}
    with TdmsWriter(str(path)) as writer:
        parts = {name: np.array_split(values, segments) for name, values in columns.items()}
        for k in range(segments):
            writer.write_segment(
                [ChannelObject("run", n, part[k], properties=about) for n, part in parts.items()]
            )


def tdms_dated(path: Path, columns: Columns, times_s: NDArray) -> None:
    """A channel of dates, numbers, and a channel of text."""
    from nptdms import ChannelObject, TdmsWriter

    stamps = _START + np.round(times_s * 1e6).astype("m8[us]")
    with TdmsWriter(str(path)) as writer:
        channels = [ChannelObject("run", name, values) for name, values in columns.items()]
        note = ChannelObject("run", "note", ["begin", "end"])
        writer.write_segment([ChannelObject("run", "when", stamps), *channels, note])


def json_messages(path: Path, columns: Columns, times_s: NDArray) -> None:
    """MCAP with a message of the topic /log per sample; NaN is null."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("log", "jsonschema", b"{}")
        topic = writer.register_channel("/log", "json", schema)
        for k, time_s in enumerate(times_s):
            row = {
                name: x if isinstance(x := values[k].item(), str) or x == x else None
                for name, values in columns.items()
            }
            at = START_NS + round(1e9 * time_s)
            writer.add_message(topic, at, json.dumps(row).encode(), at)
        writer.finish()


_SHEET = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_RELATIONS = "http://schemas.openxmlformats.org/package/2006/relationships"
_OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"


def _cell(value: object) -> str:
    if isinstance(value, np.datetime64):
        days = (value - np.datetime64("1899-12-30", "us")) / np.timedelta64(1, "D")
        return f'<c s="1"><v>{float(days)!r}</v></c>'
    if isinstance(value, str):
        return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>' if value else "<c/>"
    return f"<c><v>{value!r}</v></c>"


def xlsx(path: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> None:
    """A workbook of rows of texts, numbers and dates (numpy's), by hand."""
    names = list(sheets)
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    listed = "".join(
        f'<sheet name="{escape(name)}" sheetId="{k}" r:id="rId{k}"/>'
        for k, name in enumerate(names, 1)
    )
    related = "".join(
        f'<Relationship Id="rId{k}" Type="{_OFFICE}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k in range(1, len(names) + 1)
    )
    styles = f'<Relationship Id="rId99" Type="{_OFFICE}/styles" Target="styles.xml"/>'
    main = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    kinds = "".join(
        f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{main}.worksheet+xml"/>'
        for k in range(1, len(names) + 1)
    )
    parts = {
        "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/'
        'content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-'
        'package.relationships+xml"/><Override PartName="/xl/workbook.xml" '
        f'ContentType="{main}.sheet.main+xml"/>{kinds}</Types>',
        "_rels/.rels": f'<Relationships xmlns="{_RELATIONS}"><Relationship Id="rId1" '
        f'Type="{_OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_SHEET}" xmlns:r="{_OFFICE}"><sheets>{listed}'
        "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_RELATIONS}">{related}{styles}'
        "</Relationships>",
        "xl/styles.xml": f'<styleSheet xmlns="{_SHEET}"><cellXfs count="2"><xf numFmtId="0"/>'
        '<xf numFmtId="22" applyNumberFormat="1"/></cellXfs></styleSheet>',
    }
    for k, name in enumerate(names, 1):
        rows = "".join(f"<row>{''.join(map(_cell, row))}</row>" for row in sheets[name])
        parts[f"xl/worksheets/sheet{k}.xml"] = (
            f'<worksheet xmlns="{_SHEET}"><sheetData>{rows}</sheetData></worksheet>'
        )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, head + text)


def mdf(
    path: Path,
    columns: Columns,
    rate_Hz: float,
    version: str = "4.10",
    conversions: Mapping[str, dict] | None = None,
    packed: int = 0,
    unit: str = "K",
) -> None:
    """One group of channels; `conversions` are those of the file, of stored numbers."""
    from asammdf import MDF, Signal

    times = np.arange(len(next(iter(columns.values())))) / rate_Hz
    given = conversions or {}
    with MDF(version=version) as file:
        file.append(
            [
                Signal(values, times, name=name, unit=unit, conversion=given.get(name))
                for name, values in columns.items()
            ],
            acq_name="run",
        )
        # the library gives the name the suffix of its version
        Path(file.save(path, overwrite=True, compression=packed)).replace(path)
