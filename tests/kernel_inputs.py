"""What `test_kernels_property` calls each kernel with: small, seeded, of the types in use.

One function per module of kernels, of a generator of its own seed; it gives the kernel's name with
a list of arguments, so that branches can be met one by one. Types are those that the package calls
with, since another type would be compiled for this test alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from tirelog.readers.text.kernels import bytes_of

Arguments = Mapping[str, list[tuple[Any, ...]]]

#: what makes the inputs of a module's kernels, by the module's name in the package
_MAKERS: list[tuple[str, Callable[[np.random.Generator], Arguments]]] = []
#: kernels that give room which is filled later
UNSET: set[str] = set()


def inputs_of(module: str) -> Callable[[Callable[[np.random.Generator], Arguments]], None]:
    """Registers the inputs of a module's kernels."""

    def register(make: Callable[[np.random.Generator], Arguments]) -> None:
        _MAKERS.append((module, make))

    return register


@cache
def inputs() -> dict[str, list[tuple[Any, ...]]]:
    """By the kernel's name in the package: all arguments that it is called with."""
    return {
        f"{module}.{name}": cases
        for module, make in _MAKERS
        for name, cases in make(np.random.default_rng(zlib.crc32(module.encode()))).items()
    }


def holed(rng: np.random.Generator, *shape: int, share: float = 0.05) -> np.ndarray:
    """Normal numbers, some of them lost."""
    values = rng.normal(size=shape)
    values[rng.uniform(size=shape) < share] = np.nan
    return values


# ---- dsp


@inputs_of("dsp.filters")
def _(rng: np.random.Generator) -> Arguments:
    cutoff = np.array([20.0, 45.0, 3e3, 0.1])
    spectra = rng.normal(size=(4, 36)) + 1j * rng.normal(size=(4, 36))
    shaped, noise = np.zeros((2, 4, 36), complex), np.zeros((4, 2))
    return {
        "_derived": [(spectra, 7.5, cutoff, 70 + k, 2 - k, shaped, noise) for k in range(2)],
    }


@inputs_of("dsp.encoder")
def _(rng: np.random.Generator) -> Arguments:
    time = np.cumsum(rng.uniform(0.004, 0.02, 30))
    time[12] = time[11]
    count, rate = np.arange(30, dtype=np.int32), rng.uniform(40, 60, 30).astype(np.float32)
    at = np.concatenate([np.linspace(time[0] - 0.01, time[-1] + 0.01, 40), time[[20, 3]]])
    return {"_hermite": [(at, time, count, rate, 0.05, np.zeros(at.size))]}


@inputs_of("dsp.pitch")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.dsp.encoder import SUMS
    from tirelog.dsp.pitch import MOST_REACH

    n = 120
    time = np.cumsum(1e-3 * (1.0 + 0.05 * rng.normal(size=n)))
    time[60:] += 0.05  # a standstill
    count, stretch = np.arange(n, dtype=np.int64), np.zeros(n, np.int64)
    count[90:], stretch[90:] = count[90:] + 7, 1
    sums = np.zeros((MOST_REACH + 1, 16), SUMS)
    return {
        "_even_runs": [(time, count, stretch)],
        "_local_cubics": [(time, count, stretch, 0.05, 2, n, -np.inf, sums)],
    }


# ---- readers and runs


@inputs_of("readers.mcap.records")
def _(rng: np.random.Generator) -> Arguments:
    records = [
        bytes([op]) + len(body).to_bytes(8, "little") + body
        for op, body in ((5, b"abc"), (3, b""), (5, bytes(rng.integers(0, 256, 40, np.uint8))))
    ]
    whole = b"".join(records)
    return {
        "_chain": [
            (bytes_of(whole), np.zeros(9, np.int64)),
            (bytes_of(whole[:-1]), np.zeros(9, np.int64)),
            (bytes_of(whole), np.zeros(1, np.int64)),
        ]
    }


@inputs_of("readers.text.times")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.readers.text import times

    cells = (b"2024-02-29T23:59:58.125", b"2023-02-29T10:00:00.500", b"1999-12-31x00:00:07.001")
    pattern = bytes_of(cells[0])
    match = times._FORMS["iso"].fullmatch(cells[0].decode())
    assert match is not None
    starts = np.arange(3) * len(cells[0])
    out, done = np.zeros(3, np.int64), np.zeros(3, bool)
    half = bytes_of(b"1:02:03PM0:02:03PM")
    hms = times._FORMS["hms"].fullmatch("1:02:03PM")
    assert hms is not None
    return {
        "_days": [(2024, 2, 29), (1970, 1, 1), (1969, 13, 1), (1600, 12, 31)],
        "times_alike": [
            (half, np.arange(2) * 9, half[:9], times._roles(hms, False), False, -43_200)
            + (np.zeros(2, np.int64), np.zeros(2, bool)),
            *(
                (bytes_of(b"".join(cells)), starts, pattern, times._roles(match, False), dated)
                + (3600, out, done)
                for dated in (True, False)
            ),
        ],
    }


@inputs_of("readers.text.kernels")
def _(rng: np.random.Generator) -> Arguments:
    cells = (
        b"1550.0003", b"-12,5e3", b"+7", b"000.1000", b"9223372036854775807", b"1e99999", b".",
        b"1.5E-7", b"123456789012345678901", b"-.5",
    )  # fmt: skip
    words = [np.frombuffer(text, np.uint64)[0] for text in (b"15500003", b"12.45678", b"x2345678")]
    mantissas = [int(m) for m in rng.integers(1 << 53, (1 << 63) - 1, 4)]
    return {
        "value_of": [(words[0] & np.uint64(0x0F0F0F0F0F0F0F0F),)],
        "not_digits": [(word,) for word in words],
        "leading_digits": [(word,) for word in words],
        "digits_number": [(bytes_of(c + b"\n" * 9), 0, 46) for c in cells],
        "as_count": [(15500003, -4, 4), (1, 3, 4), (0, 0, 0), (5, -6, 4), (-7, 0, 9), (-1, 0, 2)],
        "as_float": [
            *((m, e, False) for m in mantissas for e in (-30, 0, 44)),
            (0, 3, True),
            (-5, -3, True),
            (7, 200, False),
        ],
        "word": [(bytes_of(b"15500003.2"), at) for at in (0, 2)],
    }


@inputs_of("readers.text.kernels")
def _(rng: np.random.Generator) -> Arguments:
    u64 = np.uint64
    mantissas = [u64(m) for m in rng.integers(1 << 53, (1 << 63) - 1, 4)]
    return {
        "_product": [(mantissas[0], mantissas[1]), (u64(2**64 - 1), u64(2**64 - 1))],
        "rounded": [(m, e) for m in mantissas for e in (-90, -3, 5, 99)]
        + [(u64((1 << 53) + 1), 0)],
    }


@inputs_of("runs.stamps")
def _(rng: np.random.Generator) -> Arguments:
    read = 0.01 * np.cumsum(rng.integers(1, 3, 40)) + 1e-4 * rng.normal(size=40)
    unknown = read.copy()
    unknown[[4, 9]] = np.nan
    read.flags.writeable = False
    return {"residual_range": [(7, some, 0.01) for some in (read, unknown, unknown[4:5])]}


@inputs_of("data.setup")
def _(rng: np.random.Generator) -> Arguments:
    lost = -(1 << 31)
    counts = rng.integers(-60_000, 60_000, 50).astype(np.int32)
    counts[[3, 17]] = lost
    return {"si_of_counts": [(counts, 1e-4, 1549.0, lost, np.zeros(50))]}


@inputs_of("inference.stacks.align")
def _(rng: np.random.Generator) -> Arguments:
    from scipy.interpolate import CubicSpline

    passages = np.cumsum(rng.uniform(0.9, 1.1, 7))
    course = CubicSpline(passages, 2 * np.pi * np.arange(7), bc_type="natural")
    time = np.linspace(passages[0] - 0.8, passages[-1] + 0.8, 300)
    values = holed(rng, 300)
    room = np.zeros(300, np.int64), *np.zeros((2, 300))
    turn, phi = rng.integers(0, 4, 200), rng.uniform(-np.pi, np.pi, 200)
    phi[:2], y = (-np.pi, np.nextafter(np.pi, 4.0)), rng.normal(size=200)
    knots = np.linspace(-np.pi, np.pi, 9)
    shape = CubicSpline(knots, np.cos(knots), bc_type="periodic")
    bins = np.zeros(16, np.int64), *np.zeros((2, 16))
    sums = np.zeros((4, 3, 3)), np.zeros((4, 3)), np.zeros(4, np.int64)
    cells = np.zeros((4, 64), np.int64), *np.zeros((3, 4, 64))
    return {
        "turns_of": [
            (time, values, course.x, course.c, course(passages[[0, -1]], 1), first, stop, *room)
            for first, stop in ((0, 7), (2, 4))
        ],
        "by_angle": [(phi, y, *bins)],
        "by_front": [(turn, phi, y, 1.0, shape.x, shape.c, *sums)],
        "by_bin": [(turn, phi, y, *cells)],
    }


def text_rows() -> tuple[Any, Any, list[int]]:
    """Rows of text, what to do with their columns, and where each row ends."""
    from tirelog.readers.text import kernels

    rows = [
        b"1.25,1550.0001,-3.5,ok,12:00:01,x,0,1e3\n",
        *(b"%d.%02d,15%02d.%04d,-%d.5,ok,12:00:%02d,x,7,2\n" % (k, k, k, 9 * k, k, k)
          for k in range(2, 8)),
        b"8.1, 1550.5 ,nan,bad,12:00:09,y,-1,99999999999\n",
        b"9.00,0,-1,,12:00:10,,-1,1.5\r\n",
        b"10.00,1550.0001,1,ok,12:00:11,z\n",
    ]  # fmt: skip
    data = b"".join(rows)
    whats = (kernels.TICK, kernels.COUNT, kernels.FLOAT, kernels.SKIP, kernels.SPAN, kernels.SPAN)
    guides = np.zeros(8, kernels.GUIDE)
    for k, (what, slot, places, marks) in enumerate(
        zip((*whats, kernels.COUNT, kernels.FLOAT),
            (0, 0, 0, 0, 0, 1, 1, 1), (0, 4, 0, 0, 0, 0, 0, 0),
            (0, 1, 1, 0, 0, 0, 0, 0), strict=True)
    ):  # fmt: skip
        guides[k] = what, slot, places, bool(marks), False, 0, 0
    guides["what"][7] = kernels.SKIP
    return bytes_of(data + b"\n" * 60), guides, np.cumsum([len(row) for row in rows]).tolist()


def columns_of_text(rows: int) -> tuple[Any, ...]:
    """Room for the columns of `text_rows`."""
    from tirelog.readers.text.kernels import CELL_SPAN

    counts = np.zeros((2, rows), np.int32)
    floats, ticks = np.zeros((2, rows)), np.zeros((1, rows), np.int64)
    return np.zeros(rows, np.int64), counts, floats, ticks, np.zeros((2, rows), CELL_SPAN)


@inputs_of("readers.text.kernels")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.readers.text import kernels

    data, guides, _ = text_rows()
    blanks = bytes_of(b"a \t b\t\r\n  c d  \n")
    word = np.frombuffer(b"15500003", np.uint64)[0]

    def room(width: int, rows: int) -> tuple[Any, ...]:
        return *columns_of_text(rows), np.zeros(width, kernels.HARD)

    return {
        "collapsed": [(blanks, np.zeros(blanks.size, np.uint8))],
        "unquoted": [
            (bytes_of(text), 34, 44, np.zeros(len(text), np.uint8))
            for text in (b'"1,5", "a ""b"", c",7" x\n"2,5,3\n4,"",\n',)
        ],
        "_after_blanks": [(bytes_of(b"  \r x"), 0, 44), (bytes_of(b"  x"), 0, 32)],
        "_is_lost": [(bytes_of(b"NaN,1"), a, b) for a, b in ((0, 3), (3, 3), (1, 4))],
        "_together": [(word, word, 4, 4), (word, word, 8, 7), (word, word, 3, 0)],
        "_fits": [
            (what, 4, whole, behind)
            for what in (kernels.COUNT, kernels.FLOAT)
            for whole, behind in ((4, 4), (6, 2), (8, 8), (0, 1))
        ],
        "_are_digits": [
            (np.uint64(w), n) for w in (0x3130393835353031, 0x2E303938) for n in (1, 4, 8)
        ],
        "parse_rows": [
            (data, 0, guides.copy(), 44, 46, 6, rest, *room(most, rows))
            for rest, most, rows in ((True, 60, 12), (False, 9, 12), (True, 60, 5))
        ],
    }


# ---- strain


@inputs_of("strain.footprint.family")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.footprint.family import ORDERS, SHAPES, TERMS, _mass

    kappa = np.arange(1.0, 40.0, 3.0) / 0.3
    shape, mass = np.array([0.06, 0.012, 0.4, 0.8, 0.1, -0.2]), _mass()
    waves = np.zeros((kappa.size, 2 * TERMS + 3))
    own = rng.normal(size=SHAPES), np.linspace(0.0, 0.2, kappa.size)
    return {
        "spherical_bessel": [(z, np.zeros(ORDERS)) for z in (0.02, 1.5, 7.0, 16.5, 40.0)],
        "inverted": [(rng.normal(size=(7, 7)),), (np.eye(3)[[2, 0, 1]].copy(),)],
        "_transforms": [(kappa, 0.06, waves, waves.copy())],
        "form_spectra": [(kappa, 0.3, shape, mass, *own)],
    }


@inputs_of("strain.footprint.measure")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.footprint import kernels, measure

    xi = (np.arange(160) - 80.0) / 30.0
    rows = np.stack([np.exp(-(((xi - s) / 1.1) ** 2)) for s in (0.0, 0.3, -5.0)])
    first, second = np.gradient(rows, axis=1), np.gradient(np.gradient(rows, axis=1), axis=1)
    motion = kernels.motion_of(
        np.full(3, 40.0), 900.0, np.array([14.0, 12.0, 0.01]), np.array([1.0, -2.0, -30.0])
    )
    return {
        "_along": [(0.3, -4.0, 0.02, speed, -3.0) for speed in (14.0, 0.01)],
        "least": [
            (second[0], 20.0, 140.0),
            (second[1], -5.0, 55.5),
            (first[0], 3.0, 9.0),
            (rows[2], 0.0, 170.0),
        ],
        "edge_rows": [
            (first, second, motion, np.full(3, 0.5), np.full((3, 2), 1e-3), 2)
            + (np.zeros(3, measure.EDGES),)
        ],
    }


def fits(rng: np.random.Generator) -> dict[str, Any]:
    """Noisy rows of passages that hold a form's columns, how they move, and the form."""
    from tirelog.strain.footprint import kernels as k

    xi = -0.15 + 1e-3 * np.arange(301)
    bell = np.exp(-((xi / 0.05) ** 2))
    table = np.column_stack([bell * np.cos(10.0 * n * xi + 0.3 * n) for n in range(8)])
    table[:, 5:7] *= 1e-2
    table[:, 7] *= 1e-4
    speed = rng.uniform(12, 16, 5)
    motion = k.motion_of(30 + rng.uniform(-0.5, 0.5, 5), 2500.0, speed, rng.normal(0, 2, 5))
    values = 0.7 + 0.02 * rng.normal(size=(5, 61))
    for row, moves in zip(values, motion, strict=True):
        time = (np.arange(61) - moves["centre"]) / moves["rate_Hz"]
        place = moves["speed_m_s"] * time
        for column, share in zip(table.T, (1.0, 0.05, 0.04, 0.03, 0.03), strict=False):
            row += share * np.interp(place, xi, column)
    values[rng.uniform(size=values.shape) < 0.02] = np.nan
    values[3, 4:] = np.nan  # too few
    grids = np.array([(-0.15, 1e-3, 196.0, 0.003, 0.13)], k.GRID)
    used, wide = 41, 8
    columns = rng.normal(size=(used + k.SPARE, wide + 1))
    gram = columns[:used].T @ columns[:used]
    lower, inverse = np.zeros((k.OWN, k.OWN)), np.zeros((k.OWN, k.OWN))
    k.own_inverse.py_func(gram, wide, 0.02, 0.3, lower, inverse)  # type: ignore[attr-defined]
    return locals()


@inputs_of("strain.footprint.kernels")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.footprint import kernels as k

    made = fits(rng)
    values, motion, table, grids = (made[n] for n in ("values", "motion", "table", "grids"))
    columns, gram, inverse, wide = (made[n] for n in ("columns", "gram", "inverse", "wide"))
    room, six = np.zeros((61 + k.SPARE, wide + 1)), np.zeros((k.OWN, k.OWN))
    number, found = np.zeros(5, np.int64), np.full(5, np.nan, k.FIT)
    return {
        "look_up": [
            (row, moves, table, grids[0], 0.002, 1.0, 7, wide, room, np.zeros(61))
            for row, moves in zip(values, motion, strict=True)
        ],
        "products": [(columns, 41, wide, np.zeros((wide + 1, wide + 1)))],
        "own_inverse": [(gram, wide, 0.02, 0.3, six, six.copy())],
        "apply_inverse": [(inverse, gram[wide], np.zeros(k.OWN))],
        "bend": [(0.02, 1.5, 2.0), (np.nan, 1.0, 1.0), (3.0, -1.0, 1.0)],
        "quadratic_form": [(gram, wide, rng.normal(size=wide))],
        "fitted": [(gram, inverse, 0.9, np.zeros((3, k.OWN)), np.zeros(k.FITTED))],
        "fit_rows": [(values, motion, number, table[None], grids, 0.02, 0.3, found)],
        "class_sums": [(values, motion, table[:, :6].copy(), grids[0], -1e-4, 0.02, 0.3, 20)],
    }


@inputs_of("strain.footprint.kernels")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.footprint import kernels as k

    made = fits(rng)
    values, motion, table, grids = (made[n] for n in ("values", "motion", "table", "grids"))
    columns, inverse = made["columns"], made["inverse"]
    xi, used = made["xi"], made["used"]
    lined, sums = np.zeros((k.SPARE + 1, 4)), rng.uniform(1.0, 2.0, (k.FITTED + 2, 4))
    waves = np.column_stack([0.2 * np.clip(xi - s, 0.0, 0.02) for s in np.linspace(-0.05, 0.05, 9)])
    place = rng.uniform(0, 299, used)
    starts, shift = np.array([-0.004, 0.0, 0.004]), np.zeros(5)
    form = values, motion, table, grids[0], waves
    told, best, moved = np.zeros(4, k.TRIED), np.zeros(k.FITTED + 1), np.zeros((k.OWN, 4))
    half, tried = (values[:, ::2].copy(), motion), np.zeros(5, k.TRIED)
    for name in k.TRIED.names or ():
        tried[name] = rng.uniform(1.0, 2.0, 5)
    return {
        "_beside": [(columns, place, used, waves, 2, lined, sums)],
        "_left_of": [(sums, inverse, moved, np.zeros(4))],
        "traction_gains": [(*form, 0.02, 0.3)],
        "_joint": [(columns, place, used, waves, 3, 0.02, 0.3, 0.002, told, best)],
        "_own_shift": [(np.linspace(1.0, 2.0, 9), 0.5), (np.zeros(9), 0.5)],
        "_moved_on": [
            (
                *(values[0], motion[0], table, grids[0], 4, 0.001, 3, waves, 0.02, 0.3, 0.002),
                *(told, best, np.zeros((61 + k.SPARE, k.FITTED + 1)), np.zeros(61)),
            )
        ],
        "onset_rows": [
            (
                *form[:2],
                *half,
                *form[2:],
                2,
                shift,
                starts,
                2,
                2,
                0.02,
                0.03,
                0.3,
                enough,
                1,
                np.full(5, np.nan, k.ONSET),
            )
            for enough in (0.0, 1e9)
        ],
        "_put": [
            (20, 2, 1, 0.001, tried, np.linspace(1.0, 2.0, 9), one)
            for one in np.full(1, np.nan, k.ONSET)
        ],
        "follow_rows": [
            (*form, 2, np.full(5, 4), shift, 0.002, 2, 0.02, 0.3, np.full(5, np.nan, k.ONSET))
        ],
        "moved_waves": [
            (
                rng.normal(size=(4, 3, 50)),
                np.array([0, 3, 17]),
                np.array([0.0, 0.25, 0.9]),
                rng.normal(size=(3, 3)),
                np.zeros((3, 40)),
            )
        ],
    }


@inputs_of("strain.passages.search")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.passages.search import PULSE

    f32 = np.float32
    row = rng.normal(size=60).cumsum().astype(f32)
    stairs = np.array([0, 3, 3, 1, 1, 4, 0, 0], f32)
    peak, left, right = np.array([4, 9]), np.array([0, 6]), np.array([6, 13])
    waves = np.array([0, 1, 3, 5, 7, 4, 1, 2, 6, 8, 5, 3, 1, 0.5], f32)
    return {
        "turning_points": [
            (x, least, np.zeros(61, np.int32)) for x in (row, stairs) for least in (0.0, 1.0, 99.0)
        ],
        "half_level": [(waves, peak, left, right, np.zeros(2, PULSE))],
        "_share": [(f32(1.0), f32(4.0), 2.5), (f32(2.0), f32(2.0), 2.0), (f32(4.0), f32(1.0), 9.0)],
    }


@inputs_of("strain.passages.template")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.passages import template as k

    phi = np.linspace(-0.4, 0.4, 81)
    table = np.zeros(81, k.POINT)
    table["value"] = np.exp(-((phi / 0.12) ** 2))
    table["slope"], table["scatter"] = np.gradient(table["value"], phi), 0.01
    rate, centres = 500.0, np.array([0.5, 1.5, 2.5, 3.5])
    time_s = np.arange(2000) / rate
    samples = np.zeros(2000)
    for centre in centres:
        samples += 2.0 * np.interp(40.0 * (time_s - centre), phi, table["value"], 0.0, 0.0)
    samples += 0.01 * rng.normal(size=2000)
    samples[248:252] = samples[251] = 2.05  # stuck at the end of the range
    samples[745] += 0.9  # a spike
    samples[1251] = np.nan
    segments = np.array([(0.0, 0.0, 1 / rate), (1249.0, 2.498, 1 / rate)], k.SEGMENT)
    source = k.Source(-samples, np.zeros(0), segments, -1.0, -2.05, 1.0)
    timed = source._replace(times_s=time_s)
    rows = np.array([(t + 0.001, np.nan, 40.0, 2.0, 0.02, 1.9) for t in centres], k.ROW)
    spans = np.array([(int(rate * t) - 5, int(rate * t) + 6, 0) for t in centres], k.SPAN)
    spans["first"][3], spans["stop"][3] = 1300, 1990  # thinned
    offset = np.zeros(4)

    def room() -> k.Scratch:
        return k.Scratch(*np.zeros((len(k.Scratch._fields), k.MOST_SAMPLES)))

    def filled() -> k.Scratch:
        made = room()
        for array in made:
            array[:30] = rng.normal(size=30)
        made.weight[:30] = rng.uniform(size=30) > 0.1
        made.stuck[:30] = rng.uniform(size=30) > 0.9
        made.value[7], made.weight[7] = np.nan, 0.0
        return made

    knots = 13
    diagonal, right = (4.0, 5.0, 6.0, 7.0), (1.0, -2.0, 0.5, 3.0)
    ends = filled()
    ends.value[[3, 4, 5, 9, 10, 11, 12]] = [2.0, 2.0, 2.0, -1.0, -1.0, 2.0, -1.0]
    return {
        "fit_rows": [
            (s, 0.01, table, 0.4, rows, spans, np.zeros(4, k.FOUND), room())
            for s in (source, timed)
        ],
        "spline_sums": [
            (source, rows, offset, spans, 0.3, np.zeros((knots, knots)), np.zeros(knots), room())
        ],
        "spline_curve": [(rng.normal(size=knots), 0.3, phi, np.zeros(81), np.zeros(81))],
        "basis": [(u, which) for u in (0.0, 0.3, 1.0) for which in range(4)],
        "read_window": [(s, span, room()) for s in (source, timed) for span in spans],
        "_without_stuck": [(30, -1.0, 2.0, ends)],
        "_shapes": [(30, 0.1, 0.5, 0.1, table, 0.4, filled())],
        "_step": [(30, hold, filled()) for hold in (0.0, 3.0)],
        "_solve": [(diagonal, (0.1, 0.2, -0.3, 0.4, 0.5, -0.6), right)],
        "_wild": [(30, height, 0.01, filled()) for height in (1.0, 5.0, 1e3)],
    }


@inputs_of("strain.dissipation")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.strain.dissipation import ENERGY

    values, side = rng.normal(size=300).cumsum(), rng.normal(size=13)
    rows, low, high = np.array([2, 0]), np.array([10, 90]), np.array([90, 290])
    return {
        "revolution_sums": [(values, side, rows, low, high, np.zeros(3, ENERGY))],
        "_derivative": [(values, side), (values[:20].copy(), side)],
    }


# ---- inference


@inputs_of("inference.stacks.hum")
def _(rng: np.random.Generator) -> Arguments:
    turning = np.exp(1j * rng.normal(size=(6, 9)))
    left, first = rng.uniform(size=(6, 9)), np.array([0, 1, 3, 4])
    weighted, weight = rng.normal(size=(4, 9)), rng.uniform(size=(4, 9))
    return {
        "along_rises": [(turning, left, first, weighted, weight, np.zeros(4, np.complex128))],
    }


# ---- models


@inputs_of("physics.spectral")
def _(rng: np.random.Generator) -> Arguments:
    at = np.array([[0, 1, 9, 10], [11, 0, 5, 10], [3, 11, 0, 0]])  # either end of the round
    weights = [rng.normal(size=at.shape) for _ in range(4)]
    weights[0][1, 1] = np.nan
    return {"interpolated": [(rng.normal(size=(3, 12)), at, *weights, np.empty(at.shape))]}


# ---- tires in motion


@inputs_of("physics.moving.contact")
def _(rng: np.random.Generator) -> Arguments:
    from tirelog.physics.moving.contact import SEEN

    nodes, start, some = 24, 20, 7
    n = np.arange(1.0, 6.0)
    turns = np.outer(n, 2.0 * np.pi * np.arange(2 * nodes) / nodes)
    cosines, sines = np.cos(turns), np.sin(turns)
    phi = 0.2 * np.linspace(-1.0, 1.0, some)
    real, imag = 1e-3 * rng.normal(size=(2, 5))
    s, z = 0.3 * np.sin(phi), 0.002 * rng.normal(size=some)
    slope, height = 0.1 * rng.normal(size=some), np.zeros(some)
    was = np.full(nodes, np.nan, SEEN)
    for k, field in enumerate((0.3, 0.001, -0.001, 4.0)):
        was[SEEN.names[k]][:22] = field * (1.0 + 0.01 * rng.normal(size=22) * (k < 3))  # type: ignore[index]
    bristles = 1e-4 * rng.normal(size=nodes)
    forces = rng.normal(size=(2, some))
    forces[:, 2] = 0.0
    return {
        "places": [
            (cosines, sines, start, n, real, imag, 0.3, 0.1, 0.29, np.sin(phi), np.cos(phi))
        ],
        "press": [
            (s, z, height, slope, was, bristles, start, nodes, 2e6, c_x, mu, 5.0)
            for c_x, mu in ((1e6, 0.8), (0.0, 0.0))
        ],
        "modes_of": [(cosines.T.copy(), sines.T.copy(), start, *forces, n, nodes)],
    }


def factored(rng: np.random.Generator, size: int) -> Any:
    """Factors of a circulant with a large diagonal."""
    from tirelog.simulation.rolling import belt as banded

    system = banded.factors.py_func(size)  # type: ignore[attr-defined]
    system.stencil[:] = rng.normal(size=11)
    system.stencil[5] += 12.0
    banded.factor.py_func(system)  # type: ignore[attr-defined]
    return system


@inputs_of("simulation.rolling.belt")
def _(rng: np.random.Generator) -> Arguments:
    system, x = factored(rng, 24), rng.normal(size=24)
    return {
        "factors": [(24,)],
        "factor": [(system,)],
        "solve": [(system, x, np.zeros(24))],
        "apply_circulant": [(system.stencil, x, np.zeros(24))],
    }


@inputs_of("simulation.rolling.step_kernel")
def _(rng: np.random.Generator) -> Arguments:
    from tests.simulation.rolls import LEVEL, belt, orders, rolling, strain_rider
    from tirelog.simulation.rolling import step_kernel as kernel
    from tirelog.simulation.rolling.world import TrueProfile

    made = belt(32, bristle_stiffness_N_m2=3e7, radial_damping_N_s_m2=300.0)
    hill = TrueProfile(
        np.array([0.0, 0.02, 0.05, 0.06]), np.array([0.0, 0.004, 0.004, 0.0]), 1e-4, 0.2
    )
    step, size = 2.5e-5, 32
    tires = [rolling(made, speed=8.0, load=2000.0, profile=p, step=step) for p in (LEVEL, hill)]
    for tire in tires:
        tire.u += 1e-3 * rng.normal(size=size)
    drive = orders(9, speed=8.0, load=2000.0, torque=20.0, step=step)
    rider = strain_rider(made, 0.3)

    def room() -> Any:
        return np.zeros(1, kernel.CONTACT)[0]

    def of(tire: Any) -> tuple[Any, ...]:
        return tire.v, tire.u, tire.state, tire.constants, tire._stencils, tire._middles

    stiff = factored(rng, size)
    cases: dict[str, list[tuple[Any, ...]]] = {name: [] for name in ("touch", "run_steps")}
    for tire in tires:
        road = tire.profile.corner_m, tire.profile.height_m
        state, shape = (tire.state, tire.constants), (tire._basis, tire._circle)
        cases["touch"] += [
            (tire.v, *state, *shape, *road, tire._tread, 1, np.zeros(size), room()),
        ]
        cases["run_steps"] += [
            (tire.v, tire.u, *state, tire._stencils, *shape, tire._middles, *road, tire._tread)
            + (drive, rider, np.zeros(1, np.int64), step, 1, 2, room())
            + (np.zeros(5, kernel.MOMENT), np.zeros((5, 1)))
        ]
    return cases | {
        "road_at": [
            (x, hill.corner_m, hill.height_m, tires[1].constants)
            for x in (-1.0, 0.0, 0.01, 0.05, 0.055, 0.3)
        ],
        "kick": [(*of(tires[1]), stiff, drive[0], step, 12.0, rng.normal(size=size))],
        "belt_step": [
            (*of(tires[1]), stiff, step, np.zeros(11)),
            (*of(tires[0]), stiff, step, np.zeros(11)),
        ],
    }
