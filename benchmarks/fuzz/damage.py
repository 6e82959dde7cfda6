"""Ways to damage a file: bytes, text, TOML, HDF5 objects, MCAP messages."""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path

import h5py
import numpy as np

Rng = np.random.Generator

#: what stands instead of a number, a word or a value
CELLS = (
    "",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e400",
    "5e-324",
    "0",
    "-1",
    "-0.0",
    "9" * 400,
    "0x10",
    "1_000",
    "1,5",
    "1.5.5",
    "--3",
    "true",
    "null",
    "None",
    "=cmd|x",
    '"',
    "'",
    "\\",
    "\x00",
    "\x1b[31m",
    "\u202e",
    "\x85",
    "é",
    "日本",
    "😀",
    " ",
    "\t",
    "1e",
    "e5",
    "+",
    "2026-13-45T99:99:99",
    "31/04/2026 25:61:61",
    "9999-12-31T23:59:59",
    "-9223372036854775809",
    "18446744073709551616",
    "0.1" * 50,
    "a" * 5000,
)
#: what stands instead of a TOML value
VALUES = (
    "0",
    "-1",
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "-inf",
    "true",
    '""',
    '"x"',
    "[]",
    "{}",
    "[[[[1]]]]",
    "{ a = { b = 1 } }",
    "07:32:00",
    "1979-05-27",
    "1979-05-27T07:32:00Z",
    "9" * 400,
    "0x" + "f" * 300,
    '"' + "a" * 5000 + '"',
    '"."',
    '"/"',
    '"**foo"',
    '"\\u0000"',
    '"\\u001b[31m"',
    '"\\u202e"',
    "[" * 400 + "]" * 400,
    "[1, 2, 3]",
    '["a", 1, {}]',
    "1e-320",
    "-0.0",
    '"../../x"',
    '"nm"',
    '"g"',
    '"bar"',
    '"fbg_strain"',
    '"wheel_encoder"',
    '"radial_acceleration"',
    "{ value = 1.0, min = 2.0, max = 0.5 }",
    "{ value = nan }",
    '"where(xi)"',
    '"9**9**9"',
    '"xi/0"',
    '"exp(1e9)"',
    '"().__class__"',
    "1",
    "2",
    "48",
    "1e9",
    "1000000000000",
)


def damaged_bytes(data: bytes, rng: Rng) -> bytes:
    """One to four damages of bytes: flips, holes, repeats, cuts, NULs, foreign pieces."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        if not out:
            break
        at = int(rng.integers(len(out)))
        length = int(min(len(out) - at, 2 ** rng.integers(0, 13)))
        kind = int(rng.integers(9))
        if kind == 0:
            out[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del out[at : at + length]
        elif kind == 2:
            out[at:at] = out[at : at + length]
        elif kind == 3:
            del out[at:]
        elif kind == 4:
            out[at : at + length] = bytes(length)
        elif kind == 5:
            out[at : at + length] = rng.bytes(length)
        elif kind == 6:
            out[at:at] = rng.bytes(min(length, 64))
        elif kind == 7:
            size = int(rng.choice([2, 4, 8]))
            value = int(rng.choice([0, 1, 2**15, 2**31 - 1, 2**31, 2**32 - 1])) % 256**size
            out[at : at + size] = value.to_bytes(size, "little")
        else:
            other = int(rng.integers(len(out)))
            out[at : at + length] = out[other : other + length]
    return bytes(out)


def damaged_text(data: bytes, rng: Rng) -> bytes:
    """One to six damages of a table of text: cells, rows, separators, headers, encodings."""
    text = data.decode("latin-1")
    lines = text.split("\n")
    for _ in range(int(rng.integers(1, 7))):
        if not lines:
            break
        at = (
            int(rng.integers(min(len(lines), 12)))
            if rng.random() < 0.4
            else int(rng.integers(len(lines)))
        )
        cell = str(rng.choice(np.array(CELLS, dtype=object)))
        kind = int(rng.integers(14))
        if kind <= 3:
            cells = re.split(r"([,;\t ])", lines[at])
            cells[2 * int(rng.integers((len(cells) + 1) // 2))] = cell
            lines[at] = "".join(cells)
        elif kind == 4:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        elif kind == 5:
            del lines[at : at + int(2 ** rng.integers(0, 11))]
        elif kind == 6:
            lines[at] = lines[at][: int(rng.integers(len(lines[at]) + 1))]
        elif kind == 7:
            lines[at] += str(
                rng.choice(np.array([",", ";", "\t", ",,,,,", ",1.0", "\r", '"'], dtype=object))
            )
        elif kind == 8:
            old, new = rng.choice(np.array([",", ";", "\t", " ", ".", "|"], dtype=object), 2)
            lines = [line.replace(str(old), str(new)) for line in lines]
        elif kind == 9:
            lines[:at] = [line + "," + cell for line in lines[:at]]
        elif kind == 10:
            lines.insert(
                0,
                str(
                    rng.choice(
                        np.array(["#", "sep=;", "", cell, "\ufeff", "a" * 3000], dtype=object)
                    )
                ),
            )
        elif kind == 11:
            lines[at:] = [line.replace(".", "") for line in lines[at:]]
        elif kind == 12:
            a, b = sorted(rng.integers(len(lines), size=2))
            lines[a:b] = lines[a:b][::-1]
        else:
            lines = [",".join(line.split(",")[::-1]) for line in lines]
    joined = "\n".join(lines)
    encoding = str(rng.choice(["latin-1", "latin-1", "latin-1", "utf-8", "utf-16", "utf-8-sig"]))
    return joined.encode(encoding, "replace")


def damaged_toml(data: bytes, rng: Rng) -> bytes:
    """One to three damages of a TOML file: values, keys, tables, lines, and sometimes bytes.

    Half of the time numbers only move by up to three decades, so that the file still parses.
    """
    drawn = rng.random()
    if drawn < 0.1:
        return damaged_bytes(data, rng)
    if drawn < 0.5:
        return _other_numbers(data.decode("utf-8", "replace"), rng).encode()
    lines = data.decode("utf-8", "replace").split("\n")
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(lines)))
        value = str(rng.choice(np.array(VALUES, dtype=object)))
        kind = int(rng.integers(9))
        if kind <= 4:
            with_values = [i for i, line in enumerate(lines) if "=" in line]
            if with_values:
                at = int(rng.choice(with_values))
                lines[at] = f"{lines[at].split('=')[0]}= {value}"
        elif kind == 5:
            del lines[at]
        elif kind == 6:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        elif kind == 7:
            lines[at] = re.sub(
                r"\w+", lambda found: found.group() if rng.random() < 0.7 else "x", lines[at]
            )
        else:
            headers = [i for i, line in enumerate(lines) if line.startswith("[")]
            if headers:
                at = int(rng.choice(headers))
                name = lines[at].strip("[] ")
                lines[at] = str(
                    rng.choice(
                        np.array(
                            [
                                f"[[{name}]]",
                                f"[{name}.x]",
                                "",
                                f"{name} = {value}",
                                "[a" + ".a" * 500 + "]",
                            ],
                            dtype=object,
                        )
                    )
                )
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def _other_numbers(text: str, rng: Rng) -> str:
    """One to four of the numbers times 10^-3 to 10^3, and sometimes the other sign or none."""
    for _ in range(int(rng.integers(1, 5))):
        found = list(re.finditer(r"(?<![\w.])-?\d+(\.\d*)?(e-?\d+)?(?![\w.])", text))
        if not found:
            break
        one = found[int(rng.integers(len(found)))]
        factor = float(10 ** rng.uniform(-3, 3)) * float(rng.choice([1.0, 1.0, 1.0, -1.0, 0.0]))
        value = float(one.group()) * factor
        told = repr(value) if "." in one.group() or "e" in one.group() else str(round(value))
        text = text[: one.start()] + told + text[one.end() :]
    return text


def damage_hdf5(path: Path, rng: Rng) -> None:
    """One or two damages of objects, sizes, types and attributes by the library, or of bytes."""
    if rng.random() < 0.4:
        path.write_bytes(damaged_bytes(path.read_bytes(), rng))
        return
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(int(rng.integers(1, 3))):
            name = str(rng.choice(names))
            if file.get(name, getlink=True) is None or not isinstance(
                file.get(name, getlink=True), h5py.HardLink
            ):
                continue  # a link that this damage has made
            _damage_object(file, name, rng)


def _damage_object(file: h5py.File, name: str, rng: Rng) -> None:
    node = file[name]
    kind = int(rng.integers(6))
    if kind <= 1 and len(node.attrs):
        key = str(rng.choice(list(node.attrs)))
        values = (
            0,
            -1,
            np.inf,
            np.nan,
            1e300,
            2**62,
            "x",
            "\x1b[31m",
            b"\xff\xfe",
            np.zeros(3),
            np.zeros((2, 2)),
            1 + 2j,
            h5py.Empty("f8"),
            True,
        )
        node.attrs[key] = values[int(rng.integers(len(values)))]
    elif kind == 2:
        del file[name]
    elif isinstance(node, h5py.Dataset):
        old = node[()] if node.shape is not None and node.size < 1e6 else np.zeros(3)
        attributes = dict(node.attrs)
        del file[name]
        made = _other_dataset(file, name, old, rng)
        for key, value in attributes.items():
            if made is not None:
                made.attrs[key] = _writable(value)


def _writable(value: object) -> object:
    """An attribute's value as h5py takes it: text that a first damage made undecodable goes back as
    its bytes.
    """
    if isinstance(value, str) and not value.isprintable():
        return value.encode("utf-8", "surrogateescape")
    return value


def _other_dataset(file: h5py.File, name: str, old: object, rng: Rng) -> h5py.Dataset | None:
    values = np.asarray(old)
    kind = int(rng.integers(12))
    if kind == 0:
        file[name] = h5py.ExternalLink("other.h5", "/x")
        return None
    if kind == 1:
        file[name] = h5py.SoftLink("/nowhere")
        return None
    if kind == 2:
        return file.create_dataset(
            name, data=np.array(["a", "b"], dtype=object), dtype=h5py.string_dtype()
        )
    if kind == 3:
        return file.create_dataset(
            name, shape=(2**31,), dtype="f8", chunks=(2**27,), compression="gzip"
        )
    if kind == 4:
        return file.create_dataset(
            name, shape=(10,), dtype="f8", external=[("/etc/hostname", 0, 80)]
        )
    made = (
        np.zeros((3, 4, 5)),
        values.astype("f4") if values.dtype.kind in "iuf" else np.zeros(2),
        np.zeros(0),
        np.float64(3.0),
        values.ravel()[: values.size // 2],
        np.full(50, np.nan),
        np.zeros(5, dtype=[("a", "f8"), ("b", "i4")]),
    )
    return file.create_dataset(name, data=made[kind - 5])


def damaged_json(data: bytes, rng: Rng) -> bytes:
    """A JSON file with other values, deep nests, or broken bytes."""
    if rng.random() < 0.5:
        return damaged_bytes(data, rng)
    text = data.decode("utf-8", "replace")
    numbers = list(re.finditer(r"-?\d+(\.\d+)?(e-?\d+)?", text))
    if not numbers:
        return damaged_bytes(data, rng)
    found = numbers[int(rng.integers(len(numbers)))]
    values = (
        "NaN",
        "1e400",
        "null",
        '"x"',
        "[" * 3000 + "]" * 3000,
        "{}",
        "9" * 5000,
        "-1",
        "true",
    )
    return (
        text[: found.start()]
        + str(rng.choice(np.array(values, dtype=object)))
        + text[found.end() :]
    ).encode()


def damaged_zip(data: bytes, rng: Rng) -> bytes:
    """An archive with one member's bytes damaged under a sound checksum, or damaged as it is."""
    if rng.random() < 0.3:
        return damaged_bytes(data, rng)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        spoilt = names[-1] if rng.random() < 0.6 else str(rng.choice(names))
        for name in names:
            held = old.read(name)
            new.writestr(name, damaged_bytes(held, rng) if name == spoilt else held)
    return out.getvalue()


def damage_mcap(path: Path, rng: Rng) -> None:
    """Foreign messages under sound checksums, or damaged bytes."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    if rng.random() < 0.5:
        path.write_bytes(damaged_bytes(path.read_bytes(), rng))
        return
    with path.open("rb") as stream:
        messages = [(m.log_time, m.data) for _, _, m in make_reader(stream).iter_messages()]
    encodings = ("json", "cdr", "protobuf", "ros1", "", "x\x1b[31m\n")
    schemas = ("jsonschema", "ros2msg", "protobuf", "", "ros2idl")
    texts = (
        b"{}",
        b"",
        b"float64 strain\nfloat64 twin",
        b"\xff" * 50,
        b"float64[] strain",
        b"Sub[] x\n",
        b"string a\n" * 300,
    )
    topics = ("/tire", "/tire", "/t\x1b[31m\nx", "", "/" + "a" * 3000)
    foreign = (
        b"",
        b"{",
        b'{"strain": "x", "twin": null}',
        b'{"strain": 1e400, "twin": ' + b"9" * 400 + b"}",
        b"[" * 3000,
        b'{"strain": [1,2,3], "twin": 1}',
        b"\x00\x01\x00\x00" + rng.bytes(40),
        rng.bytes(200),
        b'{"strain": {"a": 1}, "twin": 2}',
        b'{"twin": 1542.0}',
        b"\xff" * 8,
        b'{"strain": ' + b"[" * 900 + b"]" * 900 + b', "twin": 1}',
    )
    with path.open("wb") as stream:
        kinds = (CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4)
        writer = Writer(
            stream,
            compression=kinds[int(rng.integers(3))],
            chunk_size=int(rng.choice([200, 20_000])),
        )
        writer.start()
        usual = rng.random() < 0.6
        schema = writer.register_schema(
            "tire",
            "jsonschema" if usual else str(rng.choice(schemas)),
            texts[0 if usual else int(rng.integers(len(texts)))],
        )
        topic = topics[int(rng.integers(len(topics)))]
        channel = writer.register_channel(
            topic, "json" if usual else str(rng.choice(encodings)), schema
        )
        share = float(rng.choice([0.0, 0.001, 0.05, 1.0]))
        jumps = float(rng.choice([0.0, 0.01]))
        for number, (at, data) in enumerate(messages):
            if rng.random() < share:
                data = foreign[int(rng.integers(len(foreign)))]
            if rng.random() < jumps:
                at = (0, 1, 2**63, 2**64 - 1, at - 10**9)[int(rng.integers(5))]
            writer.add_message(channel, at, data, at, number)
        writer.finish()


def damaged_json_table(data: bytes, rng: Rng) -> bytes:
    """A JSON table whose rows are no rows."""
    if rng.random() < 0.5:
        return damaged_json(data, rng)
    rows = (
        b"[]",
        b"{}",
        b"[1, 2]",
        b'[{"a": {}}]',
        b"null",
        json.dumps([{"a": 1}, {"b": 2}]).encode(),
        b"[[]]",
        b'"x"',
    )
    return rows[int(rng.integers(len(rows)))]
