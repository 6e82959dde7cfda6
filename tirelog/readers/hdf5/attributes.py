"""What the attributes of a dataset say: scale, unit, sampling rate.

One table of names each, matched without regard to case.

value = factor x stored + offset          (NeXus: factor x (stored + offset))
rate: an attribute of the dataset, of the groups above it, of the file; or a number stored beside it
(MATLAB keeps `Fs` so)
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.readers.hdf5.source import LIBRARY_ERRORS, SourceColumn
from tirelog.readers.rates import RATES, rate_Hz

#: (name of the factor, name of the offset, True if the offset is added before the factor)
SCALES = (
    ("scale_factor", "add_offset", False),  # netCDF, CF
    ("scaling_factor", "offset", True),  # NeXus
    ("scale", "offset", False),
    ("factor", "offset", False),
    ("slope", "intercept", False),
    ("slope", "offset", False),
    ("wf_scale", "wf_offset", False),
    ("wf_slope", "wf_intercept", False),
    ("adc_factor", "adc_offset", False),
    ("conversion_factor", "conversion_offset", False),
    ("conversion", "offset", False),  # NWB
    ("lsb", "offset", False),
    ("NI_Scale[0]_Linear_Slope", "NI_Scale[0]_Linear_Y_Intercept", False),  # LabVIEW
)
UNIT_NAMES = ("unit", "units", "unit_string", "wf_unit", "unit_y", "yunit", "physical_unit", "EU")
FILL_NAMES = ("_FillValue", "missing_value")
#: words before the unit's own spelling in attributes such as "seconds since 2026-01-01"
SINCE = re.compile(r"^\s*(\S+)\s+since\s+(.+?)\s*$", re.IGNORECASE)
#: bytes of an attribute; a larger one is not read
MOST_ATTRIBUTE_BYTES = 1 << 16


@dataclass(frozen=True)
class Scale:
    """factor x stored + offset; stored values in `lost` are lost samples.

    `decimals` if the stored numbers are decimal counts.
    """

    factor: float = 1.0
    offset: float = 0.0
    lost: tuple[float, ...] = ()
    decimals: int | None = None

    def apply(self, stored: NDArray[Any]) -> NDArray[np.float64]:
        values = stored.astype(np.float64)
        gone = np.isin(stored, self.lost) if self.lost else None
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a damaged number may leave the range of floats, and is lost then
            self._scale(values)
        if gone is not None:
            values[gone] = np.nan
        return values

    def _scale(self, values: NDArray[np.float64]) -> None:
        """Makes stored numbers into values, in place."""
        if self.decimals is not None:
            values /= 10.0**self.decimals  # correctly rounded, which a product with 0.001 is not
        elif self.factor != 1.0:
            values *= self.factor
        if self.offset:
            values += self.offset


class Attributes:
    """The attributes of an object by lower-cased name; large and unreadable ones are left alone."""

    def __init__(self, item: h5py.Group | h5py.Dataset) -> None:
        self.item = item
        try:
            self.names = {name.lower(): name for name in item.attrs}
        except LIBRARY_ERRORS:
            self.names = {}

    def raw(self, name: str) -> Any:
        """The attribute's value, or None."""
        exact = name if name in self.names.values() else self.names.get(name.lower())
        if exact is None:
            return None
        try:
            handle = self.item.attrs.get_id(exact)
            if handle.dtype.kind not in "iufbS" and h5py.check_string_dtype(handle.dtype) is None:
                return (
                    None  # references and lists are of no use here, and damaged ones crash libhdf5
                )
            if math.prod(handle.shape) * max(handle.dtype.itemsize, 1) > MOST_ATTRIBUTE_BYTES:
                return None
            return self.item.attrs[exact]
        except LIBRARY_ERRORS:
            return None

    def number(self, name: str) -> float | None:
        return as_number(self.raw(name))

    def text(self, name: str) -> str | None:
        """A text attribute (the first if there are several), or None."""
        value = self.raw(name)
        if isinstance(value, np.ndarray) and value.size:
            value = value.flat[0]
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        return value.strip("\0 ") if isinstance(value, str) else None


def as_number(value: Any) -> float | None:
    """`value` as one finite number, or None."""
    if isinstance(value, np.ndarray):
        value = value.flat[0] if value.size == 1 else None
    if isinstance(value, bytes | str):
        text = value.decode("latin-1") if isinstance(value, bytes) else value
        value = (
            float(text)
            if re.fullmatch(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*", text)
            else None
        )
    if isinstance(value, int | float | np.integer | np.floating) and math.isfinite(value):
        return float(value)
    return None


def scale_of(column: SourceColumn) -> Scale:
    """How the column's stored numbers become values."""
    attributes = Attributes(column.dataset)
    lost = tuple(v for v in map(attributes.number, FILL_NAMES) if v is not None)
    integer = column.dtype.kind in "iu"
    for factor_name, offset_name, offset_first in SCALES:
        factor, offset = attributes.number(factor_name), attributes.number(offset_name)
        if factor is None or factor == 0.0:
            continue
        offset = offset or 0.0
        exponent = round(-math.log10(abs(factor)))
        decimal = (
            integer and offset == 0.0 and 0 <= exponent <= 15 and factor == float(f"1e-{exponent}")
        )
        return Scale(
            factor, factor * offset if offset_first else offset, lost, exponent if decimal else None
        )
    offset = attributes.number("add_offset") or attributes.number("offset") or 0.0
    return Scale(1.0, offset, lost, 0 if integer and offset == 0.0 else None)


def unit_of(column: SourceColumn) -> str | None:
    """The unit that the file itself gives, as it spells it."""
    attributes = Attributes(column.dataset)
    return next((text for text in map(attributes.text, UNIT_NAMES) if text), None)


def above(column: SourceColumn) -> Iterator[h5py.Group]:
    """The groups above the column's dataset, nearest first, the file's root last."""
    group = column.dataset.parent
    while True:
        yield group
        if group.name in (None, "/"):
            return
        group = group.parent


def rate_of(column: SourceColumn) -> float | None:
    """The sampling rate [Hz] that the file states for the column, or None."""
    for item in (column.dataset, *above(column)):
        attributes = Attributes(item)
        for name, is_period in RATES.items():
            if (rate := rate_Hz(attributes.number(name), is_period)) is not None:
                return rate
    for group in above(column):
        stored = {name.lower(): name for name in group}
        for name, is_period in RATES.items():
            if (
                rate := rate_Hz(_stored_number(group, stored.get(name.lower())), is_period)
            ) is not None:
                return rate
    return None


def _stored_number(group: h5py.Group, name: str | None) -> float | None:
    """The one number in the dataset `name` of `group`."""
    if name is None or not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return None
    item = group[name]
    if (
        not isinstance(item, h5py.Dataset)
        or item.size != 1
        or item.dtype.kind not in "iuf"
        or item.external
        or item.is_virtual
    ):
        return None
    return as_number(np.asarray(item[()]))
