"""What comparisons, diagnoses and ladders give.

Frozen values, JSON by `to_json`, arrays beside for plots and pages.

`Comparison` carries waveforms with the floor's band and the residual as maps; a page that shows it
computes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.agreement import Contribution
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

Rows = list[dict[str, Any]]
#: the errors of a comparison, in the order in which they are told
ERRORS = ("rmse_heldout", "rmse", "noise_floor", "reduced_chi2")


@dataclass(frozen=True)
class Waveforms:
    """Some cells to look at: measured, predicted, floor.

    (k, m) each, in the observable's unit at angles phi (k, m) [rad]; `labels` (k,), which end with
    the file names of the `logs` (k,); `conditions` that each is driven under.
    """

    phi_rad: FloatArray
    measured: FloatArray
    predicted: FloatArray
    floor: FloatArray
    labels: tuple[str, ...]
    logs: tuple[str, ...]
    conditions: Conditions


@dataclass(frozen=True)
class Map:
    """The residual over an axis (speed [m/s] or time [s], ascending, (k,)) and the angle (m,).

    `residual` is in the observable's unit, `whitened` in standard errors; both are (k, m), NaN if
    there is nothing. Over the time of several logs, one after the other, each but the first begins
    at one of `begins`.
    """

    axis: FloatArray
    axis_name: str
    phi_rad: FloatArray
    residual: FloatArray
    whitened: FloatArray
    begins: tuple[float, ...] = ()


class ErrorTables(Mapping[str, Rows]):
    """Rows by the name of their table.

    A large table is made when it is asked for, by `parts` without being in memory as a whole.
    """

    def __init__(
        self,
        small: Mapping[str, list[dict[str, Any]]],
        large: Mapping[str, Callable[[], Iterator[list[dict[str, Any]]]]],
    ) -> None:
        self._small, self._large = small, large

    def __getitem__(self, name: str) -> Rows:
        return [row for part in self.parts(name) for row in part]

    def parts(self, name: str) -> Iterator[Rows]:
        """The rows of a table, some at a time."""
        return iter([self._small[name]]) if name in self._small else self._large[name]()

    def __iter__(self) -> Iterator[str]:
        return iter([*self._small, *self._large])

    def __len__(self) -> int:
        return len(self._small) + len(self._large)


@dataclass(frozen=True)
class Comparison:
    """A fitted model against logs.

    Errors in the observable's unit, for one revolution's value at one angle.

    rmse          on the revolutions of the fit
    rmse_heldout  on manoeuvres that the fit had not seen, each left out in its turn; None if there
                  is but one
    noise_floor   what scatter alone leaves; its part `within` manoeuvres depends on the data alone,
                  that `between` like manoeuvres on the model too: a worse one takes some of its
                  misfit for scatter, so `excess` cannot rank models; `excess_heldout_within` can
    reduced_chi2  per degree of freedom, against noise and scatter alone, of the fitted point

    `with_nuisances`: these errors beside the `nuisances` that earn a place and that the model does
    not have; None if none does.

    `tables`: rows by revolution, angle, speed, regime, conditions. `half_angle_rad` is the patch's
    half length as an angle.

    Of several observables or gratings (`member`) fitted together errors are in their noise floors,
    `parts` has the comparison of each in its own unit, `contributions` what each knows, and
    `agreement` says whether they contradict each other; waveforms and maps are those of the first.
    """

    observable: str
    unit: str
    model: Model
    rmse: float
    rmse_heldout: float | None
    noise_floor: float
    noise_floor_within: float
    noise_floor_between: float
    reduced_chi2: float
    fit_percent: float
    revolutions: int
    manoeuvres: int
    parameters: Mapping[str, Mapping[str, Any]]
    tables: ErrorTables
    waveforms: Waveforms
    by_speed: Map
    by_time: Map
    half_angle_rad: float
    remarks: tuple[str, ...] = ()
    member: str = ""
    parts: tuple[Comparison, ...] = ()
    contributions: tuple[Contribution, ...] = ()
    agreement: str = ""
    with_nuisances: Mapping[str, Any] | None = None

    @property
    def label(self) -> str:
        """What it is called beside others: the grating, else the observable."""
        return self.member or self.observable

    @property
    def excess(self) -> float:
        """What a better model could still remove on the data of the fit."""
        return excess_of(self.rmse, self.noise_floor)

    @property
    def excess_heldout(self) -> float | None:
        return None if self.rmse_heldout is None else excess_of(self.rmse_heldout, self.noise_floor)

    @property
    def excess_within(self) -> float:
        """The error above what repeats within manoeuvres, which no model has a say in."""
        return excess_of(self.rmse, self.noise_floor_within)

    @property
    def excess_heldout_within(self) -> float | None:
        """The same on manoeuvres held out: by it models of one log can be ranked."""
        held = self.rmse_heldout
        return None if held is None else excess_of(held, self.noise_floor_within)

    def to_json(self) -> dict[str, Any]:
        apart = (
            *("model", "tables", "waveforms", "by_speed", "by_time", "half_angle_rad", "remarks"),
            *("member", "parts", "contributions", "agreement"),
        )
        names = [name for name in self.__dataclass_fields__ if name not in apart]
        names += ["excess", "excess_heldout", "excess_within", "excess_heldout_within"]
        told: dict[str, Any] = plain_values(
            {name: getattr(self, name) for name in names} | {"remarks": list(self.remarks)}
        )
        if self.parts:
            key = "gratings" if all(part.member for part in self.parts) else "observables"
            told[key] = {part.label: part.to_json() for part in self.parts}
            for known in self.contributions:
                told[key][known.observable]["contribution"] = plain_values(known.to_json())
            told["agreement"] = self.agreement
        return told


@dataclass(frozen=True)
class Candidate:
    """One row of the ranking.

    `strengths`: name -> value, se, unit of the effect's parameters after its refit (or of the
    linear fit).
    """

    effect: str
    rank: int
    excess_removed: float
    p_adjusted: float
    selected: bool
    group: tuple[str, ...]
    statistic: float
    strengths: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class LadderStep:
    """One row of a ladder.

    `outcome` is start, added, removed or not_added, `decision` the same with its reason;
    `parameters` name -> value, se, unit, shift_sigma against the row before; `probability` of being
    noise.
    """

    step: int
    effect: str
    rmse_fit: float
    rmse_heldout: float | None
    noise_floor: float
    excess_heldout: float | None
    p_adjusted: float | None
    outcome: str
    decision: str
    sentence: str
    parameters: Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Ladder:
    """Steps from the base model to the floor, and the model at the top.

    With its error on manoeuvres that nothing had touched.

    The errors of the steps are those of `compare` on the `manoeuvres` that the search saw;
    `manoeuvres_locked` others were kept from it, and `rmse_untouched` is the last model's error on
    them.
    """

    observable: str
    unit: str
    steps: tuple[LadderStep, ...]
    model: Model
    verdict: str
    rmse_untouched: float | None
    floor_untouched: float | None
    strengths_by_log: tuple[Mapping[str, Any], ...]
    revolutions: int
    manoeuvres: int
    logs: tuple[str, ...]
    manoeuvres_locked: int = 0
    remarks: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """The table, one dict per step, parameters as `name` and `name_se` columns at the end."""
        names = [n for n in LadderStep.__dataclass_fields__ if n != "parameters"]
        result = []
        for step in self.steps:
            row = {name: getattr(step, name) for name in names}
            for name, value in step.parameters.items():
                row |= {
                    name: value["value"],
                    f"{name}_se": value["se"],
                    f"{name}_shift_sigma": value["shift_sigma"],
                }
            result.append(plain_values(row))
        return result

    def to_json(self) -> dict[str, Any]:
        steps = [
            {name: getattr(s, name) for name in LadderStep.__dataclass_fields__} for s in self.steps
        ]
        names = (
            "observable",
            "unit",
            "verdict",
            "rmse_untouched",
            "floor_untouched",
            "strengths_by_log",
            "revolutions",
            "manoeuvres",
            "logs",
            "manoeuvres_locked",
            "remarks",
        )
        told: dict[str, Any] = plain_values(
            {name: getattr(self, name) for name in names} | {"steps": steps}
        )
        return told


def in_unit(error: float | None, factor: float) -> str:
    """An error to read, times `factor`; a dash if there is none."""
    return "-" if error is None else f"{error * factor:.3g}"


def excess_of(rmse: float, floor: float) -> float:
    """sqrt(rmse^2 - floor^2), zero if the error lies below the floor."""
    return float(np.sqrt(max(rmse**2 - floor**2, 0.0)))


def plain_values(value: Any) -> Any:
    """The same without numpy types, tuples as lists, not-a-number and infinity as None."""
    if isinstance(value, Mapping):
        return {str(k): plain_values(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
