"""Property: the register of quality words is the only place that knows them."""

import ast
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.sources import nodes
from tirelog.report.page import log_colours
from tirelog.report.sections import recorded as sections
from tirelog.tables.frame import differences
from tirelog.vocabulary.columns import TABLES
from tirelog.vocabulary.quality import (
    OK,
    Quality,
    Use,
    flag_of,
    good,
    good_rows,
    having,
    none_of,
    quality_column,
    quality_text,
)

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once

GOLDEN = Path(__file__).parents[1] / "golden"
REGISTER = "vocabulary/quality.py"
COMPARED = {"compare --by revolution", "compare --by hit"}


def random_flags(n, seed):
    """Rows with none to three words, after one row with each."""
    rng = np.random.default_rng(seed)
    flags = none_of(n)
    for _ in range(3):
        flags |= rng.choice([0, *Quality], n).astype(np.uint32)
    flags[: len(Quality)] = list(Quality)
    return flags


@pytest.mark.parametrize("flag", Quality, ids=lambda flag: flag.word)
def test_an_entry_is_complete(flag):
    assert re.fullmatch("[a-z]+(_[a-z]+)*", flag.word)
    assert flag_of(flag.word) is flag
    assert flag.sentence[0].islower() or flag.sentence[0].isdigit()
    assert not flag.sentence.endswith(".")
    assert flag.tables
    assert set(flag.tables) <= set(TABLES) | COMPARED


def test_every_word_is_set_somewhere():
    used = {
        node.attr
        for file, node in nodes()
        if file != REGISTER
        and isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "Quality"
    }
    assert used == {flag.name for flag in Quality}


def test_a_flag_that_is_not_of_the_register_cannot_be_written():
    with pytest.raises(ValueError, match="no quality word"):
        quality_text(1 << len(Quality) | Quality.GAP)


@pytest.mark.parametrize("use", Use)
def test_a_row_is_good_if_all_of_its_words_leave_it_so(use):
    flags = random_flags(500, 3)
    harmless = {flag for flag in Quality if {use, Use.ANY} & set(flag.good_for)}
    assert harmless
    expected = [all(f in harmless for f in Quality if f & one) for one in flags.tolist()]
    assert good(flags, use).tolist() == expected
    assert having(flags, Quality.GAP | Quality.LEAK).tolist() == [
        bool(one & Quality.GAP) or bool(one & Quality.LEAK) for one in flags.tolist()
    ]


@pytest.mark.parametrize("kind", ["object", "category"])
def test_good_texts_are_those_of_good_flags(kind):
    flags = np.append(random_flags(500, 4), np.array([0, Quality.DELAY_REMOVED], np.uint32))
    column = pd.Series(quality_column(flags)).astype(kind)
    assert good_rows(column).tolist() == good(flags).tolist()
    foreign = pd.Series(["ok", "ok;wobbly", "wobbly", "", None, "delay_removed"]).astype(kind)
    assert good_rows(foreign).tolist() == [True, False, False, False, False, True]


def test_words_stand_in_the_tables_that_the_register_names():
    for path in sorted(GOLDEN.glob("*.csv")):
        name = path.stem.replace("phase_shift", "phase-shift").split("_")[0]
        for text in pd.read_csv(path)["quality"].unique():
            for word in str(text).split(";"):
                flag = flag_of(word)
                assert word == OK or (flag is not None and name in flag.tables), (path.name, word)


def test_an_unknown_word_of_a_foreign_table_is_kept():
    table = pd.DataFrame(
        {
            "log": ["a.csv"] * 4, "channel": ["x"] * 4, "revolution": range(4),
            "time_s": [0.0, 1.0, 2.0, 3.0], "speed_m_s": 10.0, "length_m": 0.1,
            "length_d2_m": 0.11, "length_d1_m": 0.09,
            "quality": ["ok", "wobbly", "ok", "gap;wobbly"],
        }
    )  # fmt: skip
    counts = sections.quality(table, "footprint").rows
    assert sorted(counts) == [["gap;wobbly", "1"], ["ok", "2"], ["wobbly", "1"]]
    drawn = (table, None, [], "tirelog footprint a.csv", log_colours(["a.csv"]))
    section = sections.table_section("footprint", drawn, [])
    assert any("2 passages without a mark" in text for text in section.text)
    assert not len(differences(table, table.copy(), {}))
    moved = table.assign(quality=["ok", "ok", "ok", "gap;wobbly"])
    assert len(differences(moved, table, {})) == 1
