"""Random effects that all manoeuvres share: what wheel, road and weather do beside the tire.

Their columns say what one unit of each amplitude does to every cell, their standard deviations how
large an amplitude is before anything is measured. An amplitude is never subtracted first: it is
found with the model's parameters, whenever those are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class SharedEffects:
    """K random effects on C cells x m angles.

    columns  (C, m, K) in the observable's unit per unit of each amplitude
    sd       (K,) standard deviation of each amplitude, in that unit
    names    (K,) of the amplitudes; group (K,) of which nuisance each is a part
    """

    columns: FloatArray
    sd: FloatArray
    names: tuple[str, ...]
    group: tuple[str, ...]

    @classmethod
    def joined(cls, parts: Sequence[SharedEffects]) -> SharedEffects:
        """All effects of the parts, which are on the same cells."""
        return cls(
            np.concatenate([part.columns for part in parts], axis=-1),
            np.concatenate([part.sd for part in parts]),
            tuple(name for part in parts for name in part.names),
            tuple(name for part in parts for name in part.group),
        )

    @property
    def groups(self) -> tuple[str, ...]:
        """The nuisances that these effects make up, each once."""
        return tuple(dict.fromkeys(self.group))

    @property
    def plain_names(self) -> tuple[str, ...]:
        """The names without whose they are: of several observables each has its own."""
        return tuple(name.rpartition(": ")[2] for name in self.names)

    def of_groups(self, groups: Sequence[str]) -> SharedEffects:
        """The effects of some nuisances alone."""
        kept = [i for i, group in enumerate(self.group) if group in groups]
        return SharedEffects(
            self.columns[..., kept],
            self.sd[kept],
            tuple(self.names[i] for i in kept),
            tuple(self.group[i] for i in kept),
        )

    def take(self, rows: NDArray[np.int64]) -> SharedEffects:
        """The effects on some of the cells."""
        return SharedEffects(self.columns[rows], self.sd, self.names, self.group)

    def __len__(self) -> int:
        return len(self.names)
