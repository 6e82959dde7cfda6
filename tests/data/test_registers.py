"""Property: the registers agree with each other and with what is made from them."""

from inspect import signature
from pkgutil import resolve_name

import pytest

import tirelog
from tirelog.cli.app import command
from tirelog.products import MAKERS
from tirelog.vocabulary import units
from tirelog.vocabulary.columns import COLUMNS
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.observables import OBSERVABLES, shown, waveform_of
from tirelog.vocabulary.tables import LOG_TABLES


def test_a_kind_s_own_unit_is_one_of_its_quantities():
    for kind in KINDS.values():
        free = not kind.quantities  # takes any
        assert free or units.UNITS[kind.source_unit][0] in kind.quantities
        assert kind.unit == "" or units.UNITS[kind.unit][1:] == (1.0, 0.0)  # SI


def test_shown_units_are_the_units_table_s():
    for observable in OBSERVABLES.values():
        factor, unit = shown(observable.name, "?")
        if unit in units.UNITS:  # 1/m is none
            assert factor * units.UNITS[unit][1] == pytest.approx(1.0, rel=1e-12)


def test_the_waveform_of_mixed_channels_is_strain():
    assert waveform_of(["radial_acceleration"]) == "radial_acceleration"
    assert waveform_of(["radial_acceleration", "fbg_strain"]) == "strain"
    assert waveform_of([]) == "strain"


@pytest.mark.parametrize("table", LOG_TABLES.values(), ids=LOG_TABLES)
def test_a_table_s_entry_names_what_is_there(table):
    assert set(table.columns) <= set(COLUMNS)
    functions = (table.made_by, table.checked_by, table.picture, table.sketch)
    named = [name for name in functions if name]
    assert all(callable(resolve_name(name)) for name in named)
    assert MAKERS[table.name].table is table
    function = getattr(tirelog, table.python_name)
    own = {option.name for option in table.asked}
    keywords = own - {"steady_step"}  # which has its unit in Python
    assert keywords <= set(signature(function).parameters)
    parsed = command().commands[table.name]
    assert " ".join(parsed.help.split()) == table.says  # its command says it as the page does
    assert own <= {parameter.name for parameter in parsed.params}
