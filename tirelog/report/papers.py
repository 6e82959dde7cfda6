"""The papers that figures and effects on the page stand on (their errata: docs/errata.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tirelog.report.page import Section

PAPERS = {
    "P1": "N. Roveri, G. Pepe, A. Carcaterra, On line estimation of rolling resistance for "
    "intelligent tires.",
    "P2": "N. Roveri, G. Pepe, A. Carcaterra, OPTYRE - A new technology for tire monitoring: "
    "Evidence of contact patch phenomena, Mechanical Systems and Signal Processing 66-67 (2016) "
    "793-810.",
    "P3": "H. Hijry, S. Mohsen, O. Albalawi, S. Ali, A. Alhawiti, G. A. Elnashar, Development and "
    "simulation of a novel mathematical model for an intelligent tire system toward predictive "
    "maintenance.",
    "P4": "New Regressors for the Direct Identification of Tire Deformation in Road Vehicles Via "
    '"In-Tire" Accelerometers.',
}
#: sections by the papers whose method they use
_METHODS = {
    "drive": ("P2", "speed"),
    "footprint": ("P2", "contact length and slip onset"),
    "dissipation": ("P1", "dissipation"),
    "phase-shift": ("P4", "patch width and phase shift"),
}


def used_papers(sections: Sequence[Section]) -> list[tuple[str, str]]:
    """(paper, what of it is on the page), of each paper that the sections name."""
    used: dict[str, list[str]] = {name: [] for name in PAPERS}
    for section in sections:
        if section.id in _METHODS:
            paper, what = _METHODS[section.id]
            used[paper].append(what)
        for name, what in section.sources:
            for paper in re.findall(r"\bP[1-4]\b", what):
                used[paper].append(name)
    return [
        (f"{paper}: {PAPERS[paper]}", ", ".join(dict.fromkeys(what)))
        for paper, what in used.items()
        if what
    ]
