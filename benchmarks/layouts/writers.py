"""Small logs in the formats that a library reads, written by that library or by hand."""

from __future__ import annotations

import json
import sqlite3
import warnings
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


def _messages(columns: Columns, rate_Hz: float, store, first: bool):
    """(topic, type, time in ns, message): vectors with stamps of up to three columns."""
    of = store.types
    names = list(columns)
    filled = [columns[name] for name in names] + [np.zeros(len(columns[names[0]]))] * 3
    for k, (x, y, z) in enumerate(zip(*filled[:3], strict=True)):
        at = START_NS + round(k * 1e9 / rate_Hz)
        stamp = of["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
        more = {"seq": k} if first else {}
        header = of["std_msgs/msg/Header"](stamp=stamp, frame_id="tire", **more)
        vector = of["geometry_msgs/msg/Vector3"](float(x), float(y), float(z))
        yield at, of["geometry_msgs/msg/Vector3Stamped"](header=header, vector=vector)


_VECTOR = "geometry_msgs/msg/Vector3Stamped"


def bag_1(path: Path, columns: Columns, rate_Hz: float, packed: str = "") -> None:
    """A ROS 1 bag with the topic /tire of stamped vectors."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, writer = get_typestore(Stores.ROS1_NOETIC), Writer(path)
    if packed:
        writer.set_compression(Writer.CompressionFormat[packed])
    with writer:
        topic = writer.add_connection("/tire", _VECTOR, typestore=store)
        for at, message in _messages(columns, rate_Hz, store, True):
            writer.write(topic, at, store.serialize_ros1(message, _VECTOR))


def bag_2(path: Path, columns: Columns, rate_Hz: float, *, definitions: bool = True) -> None:
    """The .db3 of a ROS 2 bag with the topic /tire; older ones hold no definitions."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    text, _ = store.generate_msgdef(_VECTOR, ros_version=2)
    with sqlite3.connect(path) as base:
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL"
            f"{', type_description_hash TEXT NOT NULL' if definitions else ''})"
        )
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
            "timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        values = [1, "/tire", _VECTOR, "cdr", ""]
        if definitions:
            base.execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT)")
            base.execute("INSERT INTO schema VALUES(4, 'jazzy')")
            base.execute(
                "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, "
                "encoding TEXT, encoded_message_definition TEXT, type_description_hash TEXT)"
            )
            base.execute(
                "INSERT INTO message_definitions VALUES(1, ?, 'ros2msg', ?, '')", (_VECTOR, text)
            )
            values.append("")
        base.execute(f"INSERT INTO topics VALUES({', '.join('?' * len(values))})", values)
        rows = (
            (at, bytes(store.serialize_cdr(message, _VECTOR)))
            for at, message in _messages(columns, rate_Hz, store, False)
        )
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", rows)
    base.close()


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


def uff(
    path: Path,
    columns: Columns,
    times_s: NDArray,
    *,
    binary: bool = False,
    even: bool = True,
    unit: str = "K",
) -> None:
    """Sets 58 of signals in time at the nodes 1, 2, ..., and a frequency response behind them."""
    import pyuff

    same = {"binary": int(binary), "rsp_dir": 3, "ref_node": 0, "ref_dir": 0}
    same |= {"orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "abscissa_min": 0.0}
    step = float(times_s[1] - times_s[0])
    with warnings.catch_warnings():  # it leaves files open
        warnings.simplefilter("ignore", ResourceWarning)
        file = pyuff.UFF(str(path))
        for node, values in enumerate(columns.values(), 1):
            file.write_sets(
                pyuff.prepare_58(
                    **same,
                    func_type=1,
                    rsp_node=node,
                    ord_data_type=4,
                    num_pts=len(values),
                    abscissa_spacing=int(even),
                    abscissa_inc=step if even else 0.0,
                    abscissa_spec_data_type=17,
                    ordinate_spec_data_type=0,
                    ordinate_axis_units_lab=unit,
                    x=times_s,
                    data=values,
                ),
                "add",
            )
        file.write_sets(
            pyuff.prepare_58(
                **same,
                func_type=4,
                rsp_node=1,
                ord_data_type=6,
                num_pts=8,
                abscissa_spacing=1,
                abscissa_inc=1.0,
                abscissa_spec_data_type=18,
                ordinate_spec_data_type=12,
                x=np.arange(8.0),
                data=np.ones(8) + 1j,
            ),
            "add",
        )
