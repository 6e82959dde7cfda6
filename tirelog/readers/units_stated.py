"""The unit that a log itself states, in a header or an attribute.

It is the default of a channel whose setup names none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tirelog.data.setup import ChannelSetup, Setup
from tirelog.vocabulary import units
from tirelog.vocabulary.kinds import KINDS


def with_stated_units(setup: Setup, stated: Mapping[str, str]) -> tuple[Setup, list[str]]:
    """(the setup with the units that the log states, what to say about them).

    Only channels without a unit take it.
    """
    channels, said = dict(setup.channels), []
    for name, spelt in stated.items():
        channel = channels[name]
        unit = units.canonical(spelt)
        if channel.scaled:  # the log's unit is that of what is recorded, not what the scale gives
            if channel.unit is None and unit is not None and _fits(unit, channel):
                said.append(
                    f"channel {name}: scale and offset are taken to give {channel.source_unit!r}, "
                    f"not the file's {spelt!r}; write unit in the setup"
                )
            continue
        if channel.unit is None and not KINDS[channel.kind].quantities:
            word = "".join(letter for letter in spelt if letter.isprintable()).strip()
            channels[name] = replace(channel, unit=unit or word[: units.MOST_LETTERS] or None)
        elif channel.unit is None and unit is not None and _fits(unit, channel):
            channels[name] = replace(channel, unit=unit)
        elif sentence := _contradiction(channel, spelt, unit):
            said.append(f"channel {name}: {sentence}")
    return replace(setup, channels=channels), said


def _fits(unit: str, channel: ChannelSetup) -> bool:
    return units.UNITS[unit][0] in KINDS[channel.kind].quantities


def _contradiction(channel: ChannelSetup, spelt: str, unit: str | None) -> str:
    """What to say if the log's unit is not the one that is used; else ''.

    Also '' if the log says nothing.
    """
    used = channel.source_unit
    if channel.unit is None:
        if unit == "1" and units.UNITS[used][1] == 1.0 and KINDS[channel.kind].unit == "":
            return ""  # [-] over strain
        wrong = (
            f"is none of {' or '.join(KINDS[channel.kind].quantities)}" if unit else "is not known"
        )
        return (
            f"the file gives the unit {spelt!r}, which {wrong}; {used!r} is taken; "
            "write unit in the setup"
        )
    if unit is None or units.UNITS[unit] == units.UNITS[units.canonical(used) or unit]:
        return ""
    return (
        f"the file gives the unit {spelt!r} and the setup {used!r}; the setup's is used; "
        f"write unit = {spelt!r} in the setup if the file is right"
    )
