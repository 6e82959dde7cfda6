"""What several gratings say: frozen, with its sentences and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR

ROAD, WHEEL = "road", "wheel"


@dataclass(frozen=True)
class Frame:
    """What repeats in one frame: road, wheel, or the one grating named.

    size  squared noise floors (of that grating; else the mean of all) that a free shape takes
    p     how often chance alone takes as much, over all frames that were asked
    """

    frame: str
    size: float
    p: float

    @property
    def matters(self) -> bool:
        """More than chance does, and enough to matter."""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR


@dataclass(frozen=True)
class Strengths:
    """An effect's strength as each grating has it, everything else one to all.

    values, errors (n,) of the gratings in `unit`;  q, freedom, p  of their differences
    size  squared noise floors that strengths of their own take beyond one for all
    """

    parameter: str
    unit: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    q: float
    freedom: int
    p: float
    size: float

    @property
    def contradicts(self) -> bool:
        """Do the gratings differ, by more than chance does and enough to matter?"""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR


@dataclass(frozen=True)
class GratingsFound:
    """Which grating says what.

    names, angles_deg (n,)  of all gratings;  frames: what repeats, by frame, the largest first
    alone      gratings that show what no other does;  set_apart: those without which the rest was
               asked
    agreeing   gratings that showed what no other does until an effect was named
    strengths  of each effect that was named, of the gratings in `asked`
    searched   those on which effects were searched, if not all that were asked
    """

    names: tuple[str, ...]
    angles_deg: tuple[float, ...]
    frames: tuple[Frame, ...]
    set_apart: tuple[str, ...]
    asked: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    strengths: tuple[Strengths, ...] = ()
    agreeing: tuple[str, ...] = ()

    @property
    def alone(self) -> tuple[str, ...]:
        return tuple(
            f.frame
            for f in self.frames
            if f.matters and f.frame in self.names and f.frame not in self.agreeing
        )

    def to_json(self) -> dict[str, Any]:
        """Each grating by its name, the frames, and the effects' strengths."""
        by_frame = {f.frame: f for f in self.frames}

        def of(name: str) -> dict[str, Any]:
            own = by_frame.get(name)
            return {
                "alone_size": own.size if own else 0.0,
                "alone_p": own.p if own else None,
                "contradicts": name in self.alone,
                "set_apart": name in self.set_apart,
                "strengths": {
                    s.parameter: {"value": s.values[i], "se": s.errors[i], "unit": s.unit}
                    for s in self.strengths
                    for i in [self.asked.index(name)]
                    if name in self.asked
                }
                if name in self.asked
                else {},
            }

        return {
            "gratings": {
                name: {"angle_deg": angle} | of(name)
                for name, angle in zip(self.names, self.angles_deg, strict=True)
            },
            "frames": [{"frame": f.frame, "size": f.size, "p": f.p} for f in self.frames],
            "heterogeneity": [
                {
                    "parameter": s.parameter, "q": s.q, "freedom": s.freedom, "p": s.p,
                    "size": s.size, "contradicts": s.contradicts,
                }
                for s in self.strengths
            ],
            "searched_on": list(self.searched or self.asked),
            "sentence": " ".join(self.sentences()),
        }  # fmt: skip

    def sentences(self) -> list[str]:
        """What the gratings say together, in words."""
        said = []
        for frame in self.frames:
            if not frame.matters:
                continue
            size = f"{frame.size:.2g} squared floors"
            if frame.frame == ROAD:
                said.append(f"Fixed to the road, the same in all gratings: {size}.")
            elif frame.frame == WHEEL:
                said.append(f"Fixed to the wheel, shifted by each grating's angle: {size}.")
            elif frame.frame in self.agreeing:
                said.append(
                    f"{frame.frame} seemed to show {size} of its own; beside what is named it says "
                    "what the others do."
                )
            else:
                said.append(
                    f"{frame.frame} alone shows {size} that no other grating does: its bonding, "
                    "its channel or its place across the tread, not the tire."
                )
        if self.set_apart:
            one = len(self.set_apart) == 1
            said.append(f"What follows is without {'it' if one else ', '.join(self.set_apart)}.")
        elif self.alone and len(self.names) == 2:
            said.append("Of two gratings nothing tells which is right; a third would.")
        if self.searched:
            said.append(
                f"Effects are searched on {', '.join(self.searched)}, on some of their revolutions "
                "each; every grating is asked what it says."
            )
        for s in self.strengths:
            if s.contradicts:
                told = ", ".join(
                    f"{name} {value:.3g} ± {error:.2g}"
                    for name, value, error in zip(self.asked, s.values, s.errors, strict=True)
                )
                unit = f" [{s.unit}]" if s.unit != "1" else ""
                said.append(
                    f"The gratings contradict each other on {s.parameter}{unit}: {told} (Q "
                    f"{s.q:.3g} of {s.freedom})."
                )
        return said
