"""How a text log is laid out, from its first bytes; content decides, never the suffix.

    head (bytes, up to 256 KB) --encoding--> lines --each separator tried on the rows--> Layout

Rows decide before headers do: the separator and the decimal sign are those that turn most cells of
the last lines into numbers, times or blanks; the first line from which on all lines look like these
rows is the first row; the lines above it are header, units and preamble.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from tirelog.data.setup import LogSetup
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import is_time_name, split_unit
from tirelog.readers.text.times import form_of
from tirelog.vocabulary import units

# ---- Lines of a text log cut into cells.
#
# line --time of day in front--> --separators, unless within quotes--> cells


#: for `str.translate`: a number stays one, whatever its digits
_DIGITS_ALIKE = dict.fromkeys(map(ord, "123456789"), "0")
#: a time of day that ends with a colon and is before the first separator
TIMED = re.compile(r"^\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(\.\d+)?:\s")


def split_cells(line: str, separator: str, timed: bool = False) -> list[str]:
    """A line's cells, without blanks and quotes around them.

    A separator behind the last cell makes one more, blank cell.
    """
    if timed and (match := TIMED.match(line)):
        line = (
            line[: match.end()].rstrip().rstrip(":")
            + (separator if separator != " " else " ")
            + line[match.end() :]
        )
    cells = line.split() if separator == " " else _apart(line, separator)
    return [cell.strip().strip('"') for cell in cells]


def _apart(line: str, separator: str) -> list[str]:
    """The pieces of a line between separators; those inside of quotes do not count."""
    pieces = line.split(separator)
    if '"' in line and any(piece.count('"') % 2 for piece in pieces):
        with suppress(csv.Error):
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
            if len(cells) > 1:  # else the quotes are around the whole line
                return cells
    return pieces


def filled(cells: Sequence[str]) -> int:
    """Number of cells up to the last one that is not empty."""
    return max((k + 1 for k, cell in enumerate(cells) if cell), default=0)


#: words that instruments write in place of a number
LOST_WORDS = (
    *("", "nan", "-nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---", "inf", "-inf"),
    *("1.#qnan", "-1.#ind", "1.#ind", "-nan(ind)", "1.#inf"),
)

_NUMBER = {
    sign: re.compile(rf"[+-]?(\d+{re.escape(sign)}?\d*|{re.escape(sign)}\d+)([eE][+-]?\d+)?")
    for sign in (".", ",")
}
#: marks of a comment, which some programs put in front of a header
_MARKS = ("#", "%", "//")
#: separators that are tried, the likeliest first
_SEPARATORS = "\t;,| "
#: rows kept as a sample from the head's beginning and end; last lines that the choice of a
#: separator looks at, one after the other
SAMPLE_ROWS = 200
_TAILS = (10, 3, 50, 200)
#: lines above the first row that look like rows and are reported as left out: fewer are numbers of
#: a preamble, as they stand in the heads of many instruments
_FEWEST_ABOVE = 3


#: sign between groups of three digits, sign of decimals; the first in quoted cells alone
_GROUPINGS = (
    ('"', "."),
    (".", ","),
    (",", "."),
    *((sign, decimal) for sign in "'\u2019\u00a0\u202f" for decimal in ".,"),
)
#: a number whose digits may stand in groups of three
_GROUPED = re.compile(r"\d[.,'\u2019\u00a0\u202f]\d{3}(?!\d)")
#: groups are looked for if less than this share of the cells can be read
_READABLE = 0.9


def ungrouped(text: str, sign: str, decimal: str) -> str:
    """Text without the sign between groups of three digits; `"`: a comma within quotes."""
    if sign == '"':
        return re.sub(r'"[^"]*"', _without_commas, text)
    number = rf"(?<![\w:{sign}{decimal}])[+-]?\d{{1,3}}(?:[{sign}]\d{{3}})+(?![\d{sign}])"
    return re.sub(number, _without_sign, text)


def _without_commas(quoted: re.Match[str]) -> str:
    return ungrouped(quoted[0], ",", ".")


def _without_sign(number: re.Match[str]) -> str:
    """The number without the first sign between its digits."""
    sign = number[0].lstrip("+-0123456789")[0]
    return number[0].replace(sign, "")


@dataclass(frozen=True)
class Layout:
    """A text log's layout.

    `separator` ' ' means runs of blanks; `skip` bytes and `first_line` lead to the first row.

    `names` are the header's cells, and `units` those of a unit row or of suffixes like `[nm]`,
    both of `width` or empty; `width` is the usual number of cells per row, `ragged` true if
    rows differ in it; `counts` is the number of columns of peak counts, which begin at column
    `counts_at`; `kinds` says what the cells of each column are: number, time form, blank or
    text; `timed` rows begin with a time of day and `: `. `rows` are sample rows, cut into
    cells. `losses` name lines above the first row that were left out; `counter` is true if a
    row number without a name is in front of the named cells; `misfit` is a header whose names
    cannot be laid on the columns, and then `names` hold none of them but what is sure; `quote`
    is the sign around cells, and `enclosed` is true if it encloses separators that are part of
    a cell; `grouping` are the signs between groups of three digits and before decimals.
    """

    encoding: str
    separator: str
    decimal: str
    skip: int
    first_line: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    width: int
    ragged: bool
    kinds: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    counts_at: int = 0
    counts: int = 0
    timed: bool = False
    returns: bool = False
    preamble: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    counter: bool = False
    misfit: tuple[str, ...] = ()
    quote: str = '"'
    enclosed: bool = False
    grouping: tuple[str, str] | None = None

    def name(self, column: int) -> str:
        """The column's name, '' if it has none."""
        return self.names[column] if column < len(self.names) else ""

    def unit(self, column: int) -> str:
        """The unit that the header gives the column, '' if it gives none."""
        return self.units[column] if column < len(self.units) else ""

    def cells(self, column: int) -> list[str]:
        """The column's cells in the sample rows that have it."""
        return [row[column] for row in self.rows if len(row) > column]


def sniff(head: bytes, name: str, given: LogSetup = LogSetup()) -> Layout:  # noqa: B008 - frozen
    """The layout of a text log that begins with `head`; what is `given` is not guessed.

    ReadError: it holds no rows or is no text. SetupError: what is given does not fit it.
    """
    text, encoding, start = _decode(head, name, given.encoding)
    returns = "\n" not in text and "\r" in text
    lines = text.replace("\r", "\n").split("\n") if returns else text.split("\n")
    if len(lines) > 1 and (len(head) >= 1 << 17 or not lines[-1].strip()):
        lines.pop()  # the head may end inside of a row
    clean = [line.rstrip("\r") for line in lines]
    quote = _quote(clean)
    clean = [line.replace(quote, '"') for line in clean] if quote != '"' else clean
    full = [i for i, line in enumerate(clean) if line.strip() and "\0" not in line]
    if not full:
        raise ReadError(
            "holds no rows",
            allowed="a text log has one row per sample",
            do="check the recording",
            file=name,
        )
    # numbers of four digits may be rare: in the patch alone
    in_groups = [clean[i] for i in full[len(full) // 2 :] if _GROUPED.search(clean[i])]
    grouping = _grouping(in_groups[-_TAILS[2] :], given)
    clean = [ungrouped(line, *grouping) for line in clean] if grouping else clean
    first = None
    for tail in (
        _TAILS
    ):  # the end shows what a row is: a long preamble may stand above it, a few words below
        sample = [clean[i] for i in full[-tail:]]
        timed = sum(bool(TIMED.match(line)) for line in sample) > len(sample) // 2
        _, (separator, decimal) = _separator(sample, timed, given)
        cells = [split_cells(line, separator, timed) for line in clean]
        first = (
            _first_row(full, clean, cells, decimal, tail)
            if given.header_rows is None
            else next((i for i in full if i >= given.header_rows), None)
        )
        if first is not None:
            break
    if first is None:
        raise _no_rows(full, cells, decimal, name)
    below = [i for i in full if i >= first]
    below = below if len(below) <= 2 * SAMPLE_ROWS else below[:SAMPLE_ROWS] + below[-SAMPLE_ROWS:]
    rows = [cells[i] for i in below]
    width = Counter(len(row) for row in rows[:-1] or rows).most_common(1)[0][0]
    above = [i for i in full if i < first]
    damaged = [i + 1 for i in range(first) if "\0" in clean[i]]
    losses = [
        f"line {line} holds NUL bytes and was left out; copy the log again" for line in damaged[:3]
    ]
    spoilt = _spoilt(above, cells, width, decimal)
    if spoilt:
        losses.append(f"line {above[-1] + 1} does not parse as a row and was left out")
    many = _rows_above(above, cells, rows, decimal) if given.header_rows is None else 0
    if many:
        losses.append(
            f"{many} lines above line {first + 1}, where the rows are taken to begin, look like "
            "rows and were left out; give [log] header_rows"
        )
    names, unit_row = _header(above[:-1] if spoilt else above, cells, width, separator)
    if given.columns is not None:
        if len(given.columns) > max(map(len, rows)):
            raise SetupError(
                f"[log] columns names {len(given.columns)}, the rows have {max(map(len, rows))}"
                f" cells ({separator!r} between them)",
                allowed="allowed is a name per cell",
                do="name fewer, or give the separator",
                file=name,
            )
        names, unit_row = given.columns, tuple("" for _ in given.columns)
    raw = head.replace(b"\r", b"\n") if returns else head
    # counted in bytes as they stand, since not all of them need be letters of the encoding
    skip = start
    for _ in range(first):
        skip = raw.index(b"\n", skip) + 1
    layout = Layout(
        encoding,
        separator,
        decimal,
        skip,
        first + 1,
        names,
        unit_row,
        width,
        # more than a stray row differs in width
        sum(len(row) != width for row in rows[:-1]) > max(1, len(rows) // 50),
        tuple(
            _column_kind([row[k] for row in rows if k < len(row)], decimal)
            for k in range(max(map(len, rows)))
        ),
        tuple(tuple(row) for row in rows),
        timed=timed,
        returns=returns,
        preamble=tuple(clean[i] for i in full if i < first),
        losses=tuple(losses),
        quote=quote,
        grouping=grouping,
        enclosed=separator == decimal
        or (
            quote in text
            and separator != " "
            and any(separator in cell for i in full if i >= first for cell in cells[i])
        ),
    )
    counts_at, counts = _counts(layout)
    return replace(layout, counts_at=counts_at, counts=counts)


def _no_rows(full: list[int], cells: list[list[str]], decimal: str, name: str) -> ReadError:
    """What to say of a text without rows: that their first cells cannot be read, if it is that."""
    usual = Counter(len(cells[i]) for i in full[-max(_TAILS) :]).most_common(1)[0][0]
    for i in full:
        first, *others = cells[i]
        numbers = sum(is_number(cell, decimal) for cell in others)
        if len(cells[i]) == usual and 2 * numbers > len(others):
            return ReadError(
                f"the first cell {first[:40]!r} is no number and no time that is known",
                allowed="allowed are 2024-03-12 13:00:00.5, 12/03/2024 01:00:00.5 PM, 13:00:00.5, "
                "59:30.5 and numbers",
                do="write the column in such a way, or leave it out",
                file=name,
                line=i + 1,
            )
    return ReadError(
        "holds no rows of numbers (only a header, or another format)",
        allowed="a text log has one row per sample",
        do="check the recording",
        file=name,
    )


def _decode(head: bytes, name: str, given: str | None) -> tuple[str, str, int]:
    """(text, encoding, bytes of a byte-order mark).  The encoding is `given`, or found."""
    if not head.strip():
        raise ReadError(
            "is empty", allowed="a log has one row per sample", do="check the recording", file=name
        )
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        raise ReadError(
            "is UTF-32 text",
            allowed="allowed are UTF-8, UTF-16 and cp1252",
            do="convert it first: iconv -f UTF-32 -t UTF-8 LOG",
            file=name,
        )
    strange = sum(
        head[:65536].count(bytes([c])) for c in (*range(1, 9), *range(14, 26), *range(27, 32))
    )
    first_nul = head.find(b"\0")
    if (first_nul >= 0 and _mostly_nul(head)) or strange > len(head[:65536]) // 200:
        where = f"a NUL byte at {first_nul}" if first_nul >= 0 else "control characters"
        raise ReadError(
            f"is not text ({where})",
            allowed="allowed are text, MCAP, HDF5, MATLAB, Parquet and WAV logs",
            do="check which file this is",
            file=name,
        )
    start = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    if given is not None:
        return head[start:].decode(given, errors="replace"), given, start
    try:
        return head[start:].decode("utf-8"), "utf-8", start
    except UnicodeDecodeError as problem:
        if problem.start >= len(head) - start - 4:  # the head ends inside of a character
            return head[start : start + problem.start].decode("utf-8"), "utf-8", start
    return head.decode("cp1252", errors="replace"), "cp1252", 0


def _quote(lines: list[str]) -> str:
    """The sign around cells: `'` if most lines that hold anything have it, else `"`."""
    full = [line for line in lines[-SAMPLE_ROWS:] if line.strip()]
    single = sum(bool(re.match(r"\s*'[^']*'\s*[,;|\t ]", line)) for line in full)
    return "'" if full and 2 * single > len(full) else '"'


def _mostly_nul(head: bytes) -> bool:
    """True if lines with a NUL byte are no fewer than whole ones.

    Then it is no text that lost a block to a power cut.
    """
    lines = [line for line in head.replace(b"\r", b"\n").split(b"\n") if line.strip()]
    return 2 * sum(b"\0" in line for line in lines) >= len(lines)


def is_number(cell: str, decimal: str) -> bool:
    return bool(_NUMBER[decimal].fullmatch(cell))


def _kind(cell: str, decimal: str) -> str:
    """number, blank, text, or the form of a time."""
    if is_number(cell, decimal):
        return "number"
    if cell.lower() in LOST_WORDS:
        return "blank"
    return form_of(cell) or "text"


def _grouping(sample: list[str], given: LogSetup) -> tuple[str, str] | None:
    """`Layout.grouping` of the rows, if nothing else makes their cells numbers."""
    readable = _separator(sample, False, given)[0] if sample else 1.0
    if readable > _READABLE:
        return None
    found = None
    for sign, decimal in _GROUPINGS:
        lines = [ungrouped(line, sign, decimal) for line in sample]
        known, (separator, of_decimals) = _separator(lines, False, given)
        if known > readable and sign != separator and decimal == of_decimals:
            readable, found = known, (sign, decimal)
    return found


def _separator(sample: list[str], timed: bool, given: LogSetup) -> tuple[float, tuple[str, str]]:
    """(how much of the sample is readable, the separator and decimal sign that make most of it)."""
    best, choice = (-1.0, 0.0), (given.separator or ",", given.decimal or ".")
    for separator in given.separator or _SEPARATORS:
        for decimal in given.decimal or ".,":
            if separator == decimal and not any('"' in line for line in sample):
                continue  # both can be a comma only if cells are quoted
            cells = [split_cells(line, separator, timed) for line in sample]
            flat = [cell for row in cells for cell in row]
            known = sum(_kind(cell, decimal) != "text" for cell in flat) / max(len(flat), 1)
            if separator == " ":  # one that tears quotes apart is inside of cells
                known -= sum(cell.count('"') % 2 for cell in " ".join(sample).split()) / len(flat)
            many = sum(map(len, cells)) / len(cells)
            # a separator that nowhere separates says nothing, and blanks also stand inside of dates
            score = known - (0.2 if many < 2 else 0.0) - (0.1 if separator == " " else 0.0)
            if (round(score, 2), many) > best:
                best, choice = (round(score, 2), many), (separator, decimal)
    return best[0], choice


def _is_row(cells: list[str], decimal: str, like: str) -> bool:
    """True if a line's first cell is of the rows' kind and at least half of its cells are read."""
    kinds = [_kind(cell, decimal) for cell in cells]
    readable = sum(kind != "text" for kind in kinds)
    first = kinds[0] == like or {kinds[0], like} <= {"number", "blank"}
    return (
        first
        and 2 * readable >= len(kinds)
        and any(kind not in ("text", "blank") for kind in kinds)
    )


def _first_row(
    full: list[int], lines: list[str], cells: list[list[str]], decimal: str, most: int
) -> int | None:
    """Index of the first line from which on nearly all lines look like rows."""
    tail = full[-most:]
    like = Counter(_kind(cells[i][0], decimal) for i in tail[len(tail) // 4 :]).most_common(1)[0][0]
    if like == "text":
        return None
    rows: dict[int, bool] = {}
    widths: dict[int, int] = {}
    looks: dict[str, tuple[bool, int]] = {}  # most lines look like one before
    for i in full:
        look = lines[i].translate(_DIGITS_ALIKE)
        if look not in looks:
            looks[look] = _is_row(cells[i], decimal, like), len(cells[i])
        rows[i], widths[i] = looks[look]
    usual = Counter(widths[i] for i in tail if rows[i]).most_common(1)
    if not usual:
        return None
    first, bad, above = None, 0, None
    for k, i in reversed(list(enumerate(full))):
        if rows[i] and (widths[i] > 1 or usual[0][0] == 1):
            first, bad = i, 0
            above = full[k - 1] if k else None
        elif any(cells[i]):  # blank cells between rows are lost samples
            # a row that does not parse may stand among the others, a header and a preamble stand
            # above them; or the header is there again, as a logger that starts anew writes it
            bad += 1
            if first is None or above is None:
                continue
            if not any(rows[j] for j in full[:k]):
                break
            if bad > 3:
                if not any(any(cells[j]) and cells[j] == cells[above] for j in full[:k]):
                    break
                bad = 0
    return first


def _rows_above(
    above: list[int], cells: list[list[str]], rows: list[list[str]], decimal: str
) -> int:
    """How many lines above the first row have numbers and nothing else where most rows have.

    0 if these are too few to be more than a stray line of a preamble.
    """
    like = Counter(tuple(_kind(cell, decimal) for cell in row) for row in rows).most_common(1)[0][0]
    many = sum(tuple(_kind(cell, decimal) for cell in cells[i]) == like for i in above)
    return many if many >= _FEWEST_ABOVE else 0


def _spoilt(above: list[int], cells: list[list[str]], width: int, decimal: str) -> bool:
    """True if the last line above the first row is a row itself, one that does not parse.

    It lies between the rows and a header of words that fits them, and half of it is numbers.
    """
    if len(above) < 2:
        return False
    last, header = cells[above[-1]], cells[above[-2]]
    numbers = sum(is_number(cell, decimal) for cell in last)
    words = not any(is_number(cell, decimal) for cell in header)
    return words and filled(header) == width and abs(len(last) - width) < 2 and 2 * numbers >= width


#: words by which loggers say under a name what each number is of its samples
_STATISTICS = {
    *("smp", "sample", "avg", "average", "mean", "max", "min", "std", "tot", "med", "rms"),
    *("tmx", "tmn", "hst", "wvc"),
}
#: lines above the first row among which its header is
_MOST_ABOVE = 64
#: a line that begins a section of a file
_SECTION = re.compile(r"\[[\w ]+\]")
#: the word in front of units that stand above a header, as of LabVIEW
_OF_UNITS = re.compile(r"(.*[_ ])?(units?|einheit(en)?)([_ ]label)?:?", re.I)


def _header(
    above: list[int], cells: list[list[str]], width: int, separator: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(names, units) from the lines above the first row; both empty without a header."""
    if separator == " ":  # `# a | b` over columns of blanks
        cells = [[cell for cell in row if cell != "|"] for row in cells]
    # a lone `#` leaves nothing of its line
    rows = [row for i in above[-_MOST_ABOVE:] if (row := _uncommented(cells[i], width))]
    while rows and len(rows[-1]) == 1 < width and _SECTION.fullmatch(rows[-1][0]):
        rows.pop()
    if not rows:
        return (), ()
    at = _row_of_names(rows, width)
    names = rows[at][: filled(rows[at])]
    if len(names) < min(2, width):
        return (), ()
    stated = [cell.strip("[]() ") for cell in _row_of_units(rows, at)]
    stated += [""] * (len(names) - len(stated))
    split = [split_unit(cell) for cell in names]
    units_of = [one or own for one, (_, own) in zip(stated, split, strict=False)]
    return tuple(name for name, _ in split), tuple(units_of)


def _row_of_names(rows: list[list[str]], width: int) -> int:
    """Which of the rows of a header holds the names.

    The last but those of units, of statistics, and of one word again and again. A row below units
    holds the places of an amplifier if it names no time and the row above the units does.
    """
    last = at = len(rows) - 1
    alike = [k for k, row in enumerate(rows) if len(row) == len(rows[last])]
    names = [_names_in(row) for row in rows]
    timed = [any(map(is_time_name, row)) for row in names]
    if last and _units_only(rows[last]) and len(rows[last - 1]) >= min(2, width):
        at = last - 1
    if width > 1 and len(names[at]) < min(2, filled(rows[at])):
        others = [(timed[k], len(names[k]), k) for k in alike if len(names[k]) > len(names[at])]
        at = max(others)[2] if others else at
    two_up = at - 2
    between = two_up in alike and _units_only(rows[at - 1])
    return two_up if between and timed[two_up] and not timed[at] else at


def _names_in(row: list[str]) -> set[str]:
    """The cells of a row that can be names: no statistics, none without a letter; none of units."""
    if _units_only(row):
        return set()
    letters = {cell for cell in row if re.search(r"[^\W\d_]", split_unit(cell)[0])}
    return {cell for cell in letters if cell.lower() not in _STATISTICS}


def _row_of_units(rows: list[list[str]], at: int) -> list[str]:
    """The units below the names of row `at`, next above them, or behind a word for units."""
    width = len(rows[at])
    for row in rows[at + 1 :]:
        if len(row) <= width and _has_unit(row):
            return row
    if at and len(rows[at - 1]) == width and _units_only(rows[at - 1]):
        return rows[at - 1]
    labelled = (row for row in rows[:at] if _OF_UNITS.fullmatch(row[0]) and _has_unit(row[1:]))
    row = next(labelled, [""])
    return row[1:] if filled(row) == width + 1 else ["", *row[1:]]


def _has_unit(row: list[str]) -> bool:
    """True if a cell is a unit that is known, and no statistic (min may be either)."""
    cells = (cell.strip("[]() ") for cell in row if cell and cell.lower() not in _STATISTICS)
    return any(units.canonical(cell) is not None for cell in cells)


def _uncommented(cells: list[str], width: int) -> list[str]:
    """A header's cells without a comment mark in front (numpy writes `# a b c`).

    Alone, as in `#;time`, it is a name if all have a column with it.
    """
    if cells[0] in _MARKS:
        return cells[1:] if filled(cells) != width else cells
    mark = next((mark for mark in _MARKS if cells[0].startswith(mark)), "")
    return [cells[0].removeprefix(mark).strip().strip('"'), *cells[1:]]


def _units_only(cells: list[str]) -> bool:
    """True for a row of units, such as `s;nm;nm` or `[s];[nm];`."""
    texts = [cell for cell in cells if cell]
    return bool(texts) and all(units.canonical(cell.strip("[]() ")) is not None for cell in texts)


def _column_kind(cells: list[str], decimal: str) -> str:
    """What most cells of a column are; blank only if all are."""
    seen = Counter(kind for cell in cells if (kind := _kind(cell, decimal)) != "blank")
    return seen.most_common(1)[0][0] if seen else "blank"


def _counts(layout: Layout) -> tuple[int, int]:
    """(`counts_at`, `counts`): the place and number of columns of peak counts.

    They are small whole numbers in front that add up to the number of cells behind them, in all
    rows.
    """
    rows = layout.rows[:-1] or layout.rows
    for at in range(min(4, layout.width)):
        for number in range(1, min(33, layout.width - at)):
            if all(counts_add_up(row, at, number) for row in rows) and any(
                len(row) > at + number for row in rows
            ):
                return at, number
    return 0, 0


def counts_add_up(row: Sequence[str], at: int, number: int) -> bool:
    """True if `number` cells from `at` on are counts whose sum is the number of cells behind."""
    fronts = row[at : at + number]
    return (
        len(fronts) == number
        and all(cell.isdigit() and int(cell) < 256 for cell in fronts)
        and sum(map(int, fronts)) == filled(row) - at - number
    )
