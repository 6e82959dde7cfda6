"""Sentences: facts of a diagnosis in, text out.  The only place where a diagnosis is put into words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tirelog.physics.model import Model

_WHERE = {"entry": "at the entry edge", "patch": "in the patch", "exit": "behind the exit edge", "away": "away from the patch"}
#: more logs than these are not spelled out in a command
_MOST_LOGS = 12
_PARITY = {"even": "even about the patch centre", "odd": "odd about the patch centre", "mixed": "neither even nor odd"}


def sentence_of(facts: Mapping[str, Any]) -> str:
    """The verdict in one sentence."""
    verdict, selected, share = facts["verdict"], facts["selected"], facts["share"]
    names = " and ".join(selected)
    excess = max(facts["before"] - facts["floor"], 0.0) / facts["floor"] if facts["floor"] > 0 else 0.0
    if verdict == "nothing_missing":
        return "Nothing is missing that this data could show: what the model leaves is the noise floor."
    if verdict == "too_few":
        return f"Too few manoeuvres for a test ({facts['manoeuvres']}): candidates are ranked, none is claimed."
    if verdict == "unknown":
        nearest = facts["unexplained"].get("nearest_effect")
        near = f"; the nearest, {nearest}, explains {100 * facts['unexplained']['nearest_share']:.0f} %" if nearest else ""
        return f"Something repeatable is missing ({excess:.2g} squared floors) that no effect of the catalogue explains{near}."
    if verdict == "ambiguous":
        sets = "; ".join(" or ".join(group) for group in facts["groups"])
        return f"Missing is {sets}: these data cannot tell which; with either the error falls by {100 * share:.0f} % of its excess."
    if verdict == "partial":
        rest = facts["unexplained"]
        if share >= 0.9:
            return (
                f"{names} explains {100 * share:.0f} % of the excess; the other {100 * (1 - share):.1f} % repeats and is within what "
                f"a somewhat different form of {names} would leave."
            )
        where = f" {_WHERE[rest['where']]}" if rest.get("where") else ""
        return (
            f"{names} explains {100 * share:.0f} % of the excess; the other {100 * (1 - share):.0f} % repeats{where} and has no name yet."
        )
    one = len(selected) == 1
    return f"{names} {'is' if one else 'are'} missing: {'it removes' if one else 'they remove'} {100 * share:.0f} % of the excess."


def unexplained_sentence(facts: Mapping[str, Any], few: bool) -> str:
    """What remains, in physical words."""
    if few:
        return "Whether what remains repeats cannot be tested on so few manoeuvres."
    if not facts["significant"]:
        return "What remains does not repeat from manoeuvre to manoeuvre, or is too small to matter."
    parts = []
    if facts["where"]:
        parts.append(_WHERE[facts["where"]])
        parts.append(_PARITY[facts["parity"]])
    if facts["frequency_Hz"]:
        parts.append(f"ringing at {facts['frequency_Hz']:.0f} Hz, fixed in time")
    elif facts["follows"] == "nothing":
        parts.append("the same at every speed")
    elif facts["speed_exponent"] is not None:
        parts.append(f"growing as speed to the power {facts['speed_exponent']:g}")
    elif facts["follows"]:
        parts.append(f"following {facts['follows']}")
    if facts["in_pressure"] and not facts["frequency_Hz"]:
        parts.append("as a change of the contact pressure would be")
    near = ""
    if facts["nearest_effect"]:
        near = f" The nearest effect is {facts['nearest_effect']}, which explains {100 * facts['nearest_share']:.0f} %."
    return f"What remains repeats: {', '.join(parts)}.{near}"


def next_command(verdict: str, selected: Sequence[str], *, model: Model, logs: Sequence[str]) -> str:
    """The command to type next."""
    file = str(model.path) if model.path else "MODEL.toml"
    stem = file.removesuffix(".toml")
    given = " ".join(logs) if len(logs) <= _MOST_LOGS else "LOG..."
    if verdict in ("missing", "partial", "ambiguous") and selected:
        adds = []
        for effect in selected:
            longer = f"{stem}+{effect}.toml"
            adds.append(f"tirelog model add {file} {effect} -o {longer}")
            file, stem = longer, f"{stem}+{effect}"
        return " && ".join([*adds, f"tirelog model fit {given} --model {file} -o {file}"])
    if verdict == "unknown":
        return f"tirelog compare {given} --model {file} --plot residual.png"
    if verdict == "too_few":
        return f"tirelog diagnose {given} MORE_LOGS --model {file}"
    return f"tirelog compare {given} --model {file}"
