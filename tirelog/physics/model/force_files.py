"""Forces in the files of test rigs and vehicle simulations: TYDEX tables and Magic Formulas (.tir).

    rows of `model forces` --`tydex_text`--> FILE.tdx --`read_forces`--> conditions and forces
    a model's brush        --`tir_text`---->  FILE.tir --`read_forces`--> `MagicFormula`

Both formats have ISO's W axes (x forward, y to the left, z up), and slip that is positive in
driving. P2's brush has a slip and forces that are positive against the motion. So

    LONGSLIP = -slip    FX = -road_longitudinal    FYW = -road_lateral    MZW = aligning_moment

Slip angle and inclination have the same signs in both: a positive slip angle gives a force to the
right and a positive aligning moment. The H and C axes are those of W where the wheel has no camber.

TYDEX: Unrau and Zamow, TYDEX-Format, Release 1.3, 1997. Magic Formula: Pacejka, Tire and Vehicle
Dynamics, 3rd edition, 2012, (4.E1) to (4.E67), and MF-Tyre 5.2 where its camber differs. A file
without turn slip.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tirelog.errors import ModelError, ReadError
from tirelog.storage.whole import bounded_input
from tirelog.version import __version__
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.units import UNITS, canonical

#: the suffixes of files with forces
SUFFIXES = (".tdx", ".tir")


class Channel(NamedTuple):
    """A column of `model forces` as a TYDEX channel."""

    column: str
    sign: float
    names: tuple[str, ...]
    quantity: str
    unit: str
    description: str


#: the first name is the one that is written
CHANNELS = (
    Channel("speed_m_s", 1.0, ("LONGVEL", "TRAJVELW", "TRAJVELH"), "speed", "m/s", "speed"),
    Channel("load_N", 1.0, ("FZW", "FZH", "FZC", "FZ"), "force", "N", "vertical force"),
    Channel("inflation_pressure_Pa", 1.0, ("INFLPRES",), "pressure", "Pa", "inflation pressure"),
    Channel("slip", -1.0, ("LONGSLIP",), "number", "-", "longitudinal slip"),
    Channel("slip_angle_deg", 1.0, ("SLIPANGL",), "angle", "deg", "slip angle"),
    Channel("camber_deg", 1.0, ("INCLANGL",), "angle", "deg", "inclination angle"),
    Channel(
        "road_longitudinal_N", -1.0, ("FX", "FXW", "FXH", "FXC"), "force", "N", "longitudinal force"
    ),
    Channel("road_lateral_N", -1.0, ("FYW", "FYH", "FYC", "FY"), "force", "N", "lateral force"),
    Channel(
        "aligning_moment_N_m", 1.0, ("MZW", "MZH", "MZC", "MZ"), "moment", "Nm", "aligning moment"
    ),
)
#: what a rig or a formula gives of a wheel under its conditions
FORCES = ("road_longitudinal_N", "road_lateral_N", "aligning_moment_N_m")
_BY_NAME = {name: channel for channel in CHANNELS for name in channel.names}
#: of the quantities that `UNITS` does not have
_OWN_UNITS = {"%": ("number", 0.01), "Nm": ("moment", 1.0), "N*m": ("moment", 1.0)}


@dataclass(frozen=True)
class MagicFormula:
    """The coefficients of a .tir file, by name; what it does not give is 0, or 1 of a scale."""

    values: Mapping[str, float]

    def __getitem__(self, name: str) -> float:
        usual = {"PKY4": 2.0}.get(name, 1.0 if name.startswith("L") else 0.0)
        return self.values.get(name, usual)

    def forces(self, conditions: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """(n,) `road_longitudinal_N` and `road_lateral_N`, signs as `model forces`.

        Conditions (n,): load [N], slip, slip angle and camber [deg], pressure [Pa].
        """
        fz, kappa = conditions["load_N"], -conditions["slip"]
        alpha, camber = (np.radians(conditions[f"{of}_deg"]) for of in ("slip_angle", "camber"))
        nominal = self["FNOMIN"] * self["LFZO"]
        df, usual = (fz - nominal) / nominal, self["NOMPRES"] or self["IP"]
        dp = 0.0 * fz
        if usual and "inflation_pressure_Pa" in conditions:
            dp = np.nan_to_num(conditions["inflation_pressure_Pa"] / usual - 1.0)
        gamma = np.sin(camber) if self._squared_camber else camber
        along = self._along(fz, kappa, gamma, df, dp)
        across, mu_y = self._across(fz, alpha, gamma, df, dp)
        less_x = self._weight("X", self["RBX1"] + self["RBX3"] * gamma**2, kappa, alpha, df)
        less_y = self._weight("Y", self["RBY1"] + self["RBY4"] * gamma**2, alpha, kappa, df)
        ply = mu_y * fz * (self["RVY1"] + self["RVY2"] * df + self["RVY3"] * gamma)
        ply = ply * np.cos(np.arctan(self["RVY4"] * alpha)) * self["LVYKA"]
        shift = ply * np.sin(self["RVY5"] * np.arctan(self["RVY6"] * kappa))
        return {"road_longitudinal_N": -less_x * along, "road_lateral_N": -less_y * across - shift}

    @property
    def _squared_camber(self) -> bool:
        """Whether the camber enters as from version 6 on."""
        return "PKY6" in self.values

    def _along(
        self, fz: FloatArray, kappa: FloatArray, gamma: FloatArray, df: FloatArray, dp: FloatArray
    ) -> FloatArray:
        """F_x of pure slip [N], (4.E9)."""
        c = self
        mu = (c["PDX1"] + c["PDX2"] * df) * (1.0 + c["PPX3"] * dp + c["PPX4"] * dp**2)
        peak = mu * (1.0 - c["PDX3"] * gamma**2) * c["LMUX"] * fz
        slope = fz * (c["PKX1"] + c["PKX2"] * df) * np.exp(c["PKX3"] * df) * c["LKX"]
        slope = slope * (1.0 + c["PPX1"] * dp + c["PPX2"] * dp**2)
        x = kappa + (c["PHX1"] + c["PHX2"] * df) * c["LHX"]
        bend = (c["PEX1"] + c["PEX2"] * df + c["PEX3"] * df**2) * (1.0 - c["PEX4"] * np.sign(x))
        rise = fz * (c["PVX1"] + c["PVX2"] * df) * c["LVX"] * c["LMUX"]
        return _magic(x, slope, c["PCX1"] * c["LCX"], peak, bend * c["LEX"]) + rise

    def _across(
        self, fz: FloatArray, alpha: FloatArray, gamma: FloatArray, df: FloatArray, dp: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(F_y of pure slip [N], (4.E19); its friction, (4.E23))."""
        c, nominal = self, self["FNOMIN"] * self["LFZO"]
        mu = (c["PDY1"] + c["PDY2"] * df) * (1.0 + c["PPY3"] * dp + c["PPY4"] * dp**2)
        mu = mu * (1.0 - c["PDY3"] * gamma**2) * c["LMUY"]
        reach = (c["PKY2"] + c["PKY5"] * gamma**2) * (1.0 + c["PPY2"] * dp)
        slope = c["PKY1"] * nominal * np.sin(c["PKY4"] * np.arctan(fz / nominal / reach))
        slope = slope * (1.0 + c["PPY1"] * dp) * (1.0 - c["PKY3"] * np.abs(gamma)) * c["LKY"]
        tilt = fz * (c["PVY3"] + c["PVY4"] * df) * gamma * c["LKYC"] * c["LMUY"]
        thrust = fz * (c["PKY6"] + c["PKY7"] * df) * (1.0 + c["PPY5"] * dp) * c["LKYC"]
        shift = c["PHY3"] * gamma
        if self._squared_camber:
            shift = (thrust * gamma - tilt) / slope
        x = alpha + (c["PHY1"] + c["PHY2"] * df) * c["LHY"] + shift
        bend = (c["PEY1"] + c["PEY2"] * df) * c["LEY"]
        bend = bend * (1.0 + c["PEY5"] * gamma**2 - (c["PEY3"] + c["PEY4"] * gamma) * np.sign(x))
        rise = fz * (c["PVY1"] + c["PVY2"] * df) * c["LVY"] * c["LMUY"] + tilt
        return _magic(x, slope, c["PCY1"] * c["LCY"], mu * fz, bend) + rise, mu

    def _weight(
        self, axis: str, base: FloatArray, own: FloatArray, other: FloatArray, df: FloatArray
    ) -> FloatArray:
        """Share of a pure force that the `other` slip leaves, (4.E50) and (4.E58)."""
        if f"RB{axis}1" not in self.values:
            return np.ones_like(df)
        centre = own - (self["RBY3"] if axis == "Y" else 0.0)
        scale = self["LXAL" if axis == "X" else "LYKA"]
        b = base * np.cos(np.arctan(self[f"RB{axis}2"] * centre)) * scale
        bend = self[f"RE{axis}1"] + self[f"RE{axis}2"] * df
        offset = self[f"RH{axis}1"] + self[f"RH{axis}2"] * df
        at, zero = (
            np.cos(self[f"RC{axis}1"] * np.arctan(_bent(b * x, bend)))
            for x in (other + offset, offset)
        )
        return np.asarray(at / zero)


def _bent(x: FloatArray, bend: FloatArray | float) -> FloatArray:
    return x - np.minimum(bend, 1.0) * (x - np.arctan(x))


def _magic(
    x: FloatArray, slope: FloatArray, shape: float, peak: FloatArray, bend: FloatArray
) -> FloatArray:
    """D sin(C atan(B x - E (B x - atan B x))) with B = slope / (C D)."""
    return np.asarray(peak * np.sin(shape * np.arctan(_bent(slope / (shape * peak) * x, bend))))


# ---- Reading: text of another program, hostile until parsed.


def read_forces(path: Path) -> MagicFormula | dict[str, FloatArray]:
    """A Magic Formula of a .tir file; of a TYDEX file its conditions and forces, (n,) each.

    TYDEX: SI and degrees, signs and names as `model forces`; what the file does not give is absent.
    ReadError with file and line: neither format, or a channel that cannot be used.
    """
    largest = 32 << 20  # a table of 100,000 rows and 10 channels has 13 MB
    try:
        text = bounded_input(path, largest).decode("latin-1")
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise ReadError(f"cannot be read ({reason})", do="give another file", file=path) from None
    lines = [(number, line.rstrip()) for number, line in enumerate(text.splitlines(), 1)]
    if any(line.upper().startswith("[MDI_HEADER]") for _, line in lines):
        return _read_tir(lines, path)
    if any(line.upper().startswith("**MEASURDATA") for _, line in lines):
        return _read_tydex(lines, path)
    raise ReadError(
        "has neither a [MDI_HEADER] nor a **MEASURDATA",
        allowed="allowed are a .tir file with a Magic Formula and a TYDEX file",
        do="export one of them",
        file=path,
    )


def _read_tir(lines: Sequence[tuple[int, str]], path: Path) -> MagicFormula:
    """Coefficients of a Magic Formula; units are SI."""
    values: dict[str, float] = {}
    units = {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians"}
    for number, line in lines:
        name, given, word = line.split("$")[0].partition("=")
        name, word = name.strip().upper(), word.strip().strip("'\"").lower()
        if name in units and not word.startswith(units[name][:5]):
            raise ReadError(
                f"{name} = {word!r}",
                allowed=f"allowed is {units[name]}",
                do="export the file in SI units",
            ).at(path, number)
        if given and (value := _number(word)) is not None:
            values[name] = value
    needed = ("FNOMIN", "PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2")
    missing = [name for name in needed if not values.get(name)]
    if missing:
        raise ReadError(
            f"has no {', '.join(missing)}",
            allowed="allowed are Magic Formulas from version 5.2 on (FITTYP 6, 52, 60 to 62)",
            do="export such a file",
            file=path,
        )
    return MagicFormula(values)


def _number(word: str) -> float | None:
    """A finite number, else None."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _section(lines: Sequence[tuple[int, str]], name: str) -> Iterator[tuple[int, str]]:
    """Lines of a TYDEX section, without comments."""
    inside = False
    for number, line in lines:
        if line.startswith("**"):
            inside = line[2:].strip().upper() == name
        elif inside and line.strip() and not line.startswith("!"):
            yield number, line


def _read_tydex(lines: Sequence[tuple[int, str]], path: Path) -> dict[str, FloatArray]:
    """Channels and constants that `CHANNELS` knows."""
    heads = [_head(line, path, number) for number, line in _section(lines, "MEASURCHANNELS")]
    scales = [factor * (1.0 if given is None else given) for _, factor, given in heads]
    rows = []
    for number, line in _section(lines, "MEASURDATA"):
        numbers = [_number(word) for word in line.split()]
        if len(numbers) != len(heads) or None in numbers:
            wrong = f", {numbers.count(None)} of them no numbers" if None in numbers else ""
            raise ReadError(
                f"{len(numbers)} cells{wrong}",
                allowed=f"allowed are {len(heads)} numbers, one for each of **MEASURCHANNELS",
                do="correct or remove the line",
            ).at(path, number)
        rows.append(numbers)
    most = 100_000
    if not 0 < len(rows) <= most:
        raise ReadError(
            f"has {len(rows)} rows of **MEASURDATA",
            allowed=f"1 to {most} are allowed",
            do="export a part of the test, or means",
            file=path,
        )
    table, found = np.array(rows, dtype=np.float64), {}
    for (channel, *_), scale, column in zip(heads, scales, table.T, strict=True):
        if channel is not None and channel.column not in found:
            found[channel.column] = scale * column
    for number, line in _section(lines, "CONSTANTS"):
        channel, factor, given = _head(line, path, number)
        if channel is not None and channel.column not in found and given is not None:
            found[channel.column] = np.full(len(rows), factor * given)
    used = {line.split()[0].upper() for _, line in _section(lines, "MEASURCHANNELS")} & set(
        _BY_NAME
    )
    tilted = any(
        name[-1] in "HC" for name in used if _BY_NAME[name].quantity in ("force", "moment")
    )
    if tilted and np.any(found.get("camber_deg", 0.0)):
        raise ReadError(
            "forces in H or C axes with an INCLANGL that is not 0",
            allowed="allowed are the W axes (FYW, FZW, MZW) with camber",
            do="export the W axes",
            file=path,
        )
    if "load_N" not in found or not set(FORCES) & set(found):
        raise ReadError(
            "has no vertical force, or no other force",
            allowed="FZW and one of FX, FYW and MZW are needed",
            do="export these channels",
            file=path,
        )
    return found


def _head(line: str, path: Path, number: int) -> tuple[Channel | None, float, float | None]:
    """(Channel, factor to SI or degrees with its sign, first number) of name, words, unit, numbers.

    None is a channel that is not needed.
    """
    words = line.split()
    channel = _BY_NAME.get(words[0].upper())
    numbers: list[float] = []
    while channel is not None and len(words) > 2 and len(numbers) < 3:
        value = _number(words[-1])
        if value is None:
            break
        numbers.insert(0, value)
        words.pop()
    if channel is None:
        return None, 1.0, None
    unit = words[-1].strip("[]()")
    quantity, factor = _OWN_UNITS.get(unit) or UNITS.get(canonical(unit) or "", ("", 0.0, 0.0))[:2]
    if quantity != channel.quantity or any(numbers[1:]):
        raise ReadError(
            f"{words[0]} in {unit!r}{' with an offset' if any(numbers[1:]) else ''}",
            allowed=f"allowed is {channel.unit} or another unit of {channel.quantity}, no offset",
            do="export it so",
        ).at(path, number)
    if channel.quantity == "angle":
        factor = np.degrees(factor)
    return channel, channel.sign * factor, numbers[0] if numbers else None


# ---- Writing.


def tydex_text(columns: Mapping[str, Any]) -> str:
    """Rows of `model forces` as a TYDEX file, without channels that are not known in all rows."""
    given = [
        (channel, channel.sign * np.asarray(columns[channel.column]) + 0.0)
        for channel in CHANNELS
        if channel.column in columns and np.isfinite(columns[channel.column]).all()
    ]
    heads = [
        f"{c.names[0]:<10}{c.description:<30}{c.unit:<10}{1:<10}{0:<10}{0:<10}" for c, _ in given
    ]
    rows = [
        " ".join(f"{value:<14.8g}" for value in row)
        for row in zip(*(v for _, v in given), strict=True)
    ]
    return "\n".join(
        (
            *("**HEADER", f"{'RELEASE':<10}{'release of TYDEX':<30}1.3"),
            *(f"{'SUPPLIER':<10}{'made by':<30}tirelog {__version__}", "**COMMENTS"),
            *("Computed from a model, in W axes.", "**MEASURCHANNELS", *heads),
            *("**MEASURDATA", *rows, "**END", ""),
        )
    )


#: what is fitted, along and across: (coefficient, start, lowest, highest); several loads need the
#: last two of each
_FITTED = (
    (
        *(("PCX1", 1.5, 1.0, 2.0), ("PDX1", 1.0, 0.05, 5.0), ("PEX1", 0.0, -20.0, 1.0)),
        *(("PKX1", 20.0, 0.5, 500.0), ("PDX2", 0.0, -2.0, 2.0), ("PKX2", 0.0, -200.0, 200.0)),
    ),
    (
        *(("PCY1", 1.5, 1.0, 2.0), ("PDY1", 1.0, 0.05, 5.0), ("PEY1", 0.0, -20.0, 1.0)),
        *(("PKY1", -20.0, -500.0, -0.5), ("PDY2", 0.0, -2.0, 2.0), ("PKY2", 1.5, 0.1, 20.0)),
    ),
)


def sweeps(load_N: FloatArray) -> list[dict[str, FloatArray]]:
    """Sweeps of slip and of slip angle at each load, for `tir_text`: (k,) each of a condition."""
    loads, points = np.unique(load_N), np.linspace(-1.0, 1.0, 81)
    swept = np.tile(points, loads.size)
    return [
        {
            "load_N": np.repeat(loads, points.size),
            "slip": slip * swept,
            "slip_angle_deg": angle * swept,
            "camber_deg": 0.0 * swept,
        }
        for slip, angle in ((1.0, 0.0), (0.0, 20.0))
    ]


def tir_text(swept: Sequence[Mapping[str, FloatArray]], radius_m: float) -> tuple[str, list[float]]:
    """A Magic Formula 5.2 fitted to rows of `model forces` over the two `sweeps`.

    With the root mean squares of what it leaves, along and across, over the largest force.
    """
    loads = np.unique(swept[0]["load_N"])
    known = {"FNOMIN": float(np.median(loads)), "PKX1": 1.0, "PKY1": -1.0, "PKY2": 1.5}
    left = []
    for rows, column, fitted in zip(swept, FORCES, _FITTED, strict=False):
        coefficients, rest = _magic_fit(rows, column, fitted[: 6 if loads.size > 1 else 4], known)
        known |= coefficients
        left.append(rest)
    ends = [(x.min(), x.max()) for x in (swept[0]["slip"], swept[1]["slip_angle_deg"])]
    sections: dict[str, dict[str, Any]] = {
        "MDI_HEADER": {"FILE_TYPE": "'tir'", "FILE_VERSION": 3.0, "FILE_FORMAT": "'ASCII'"},
        "UNITS": {"LENGTH": "'meter'", "FORCE": "'newton'", "ANGLE": "'radians'"},
        "MODEL": {"PROPERTY_FILE_FORMAT": "'MF-TYRE'", "FITTYP": 6, "USE_MODE": 4, "VXLOW": 1.0},
        "DIMENSION": {"UNLOADED_RADIUS": radius_m},
        "VERTICAL": {"FNOMIN": known["FNOMIN"]},
        "LONG_SLIP_RANGE": dict(zip(("KPUMIN", "KPUMAX"), ends[0], strict=True)),
        "SLIP_ANGLE_RANGE": dict(zip(("ALPMIN", "ALPMAX"), np.radians(ends[1]), strict=True)),
        "VERTICAL_FORCE_RANGE": {"FZMIN": loads[0], "FZMAX": loads[-1]},
        "LONGITUDINAL_COEFFICIENTS": {n: known[n] for n in known if n[2] == "X"},
        "LATERAL_COEFFICIENTS": {n: known[n] for n in known if n[2] == "Y"},
    }
    words = [f"$ made by tirelog {__version__}: P2's brush of a model, pure slip, no camber"]
    for name, values in sections.items():
        words += [f"[{name}]", *(f"{key:<24} = {value}" for key, value in values.items())]
    return "\n".join((*words, "")), left


def _magic_fit(
    rows: Mapping[str, FloatArray],
    column: str,
    fitted: Sequence[tuple[str, float, float, float]],
    known: Mapping[str, float],
) -> tuple[dict[str, float], float]:
    """(Coefficients that fit the force `column` of the rows, what they leave over its largest)."""
    names, start, low, high = zip(*fitted, strict=True)
    target = rows[column]
    largest = float(np.abs(target).max())
    if not largest > 0.0:
        raise ModelError(
            "a brush without force",
            allowed="a .tir file needs a friction above 0",
            do="set the friction of the model's effect `traction`",
        )

    def off(x: FloatArray) -> FloatArray:
        formula = MagicFormula({**known, **dict(zip(names, x, strict=True))})
        return np.asarray((formula.forces(rows)[column] - target) / largest)

    scale = np.maximum(np.abs(start), 0.1)
    found = least_squares(off, start, bounds=(low, high), x_scale=scale)
    return dict(zip(names, found.x.tolist(), strict=True)), float(np.sqrt(np.mean(found.fun**2)))
