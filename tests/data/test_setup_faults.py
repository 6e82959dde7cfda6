"""Faults: a setup file that is wrong is refused: what is wrong, where, and what is allowed."""

import pytest

from tirelog.data.setup import load_setup, parse_setup
from tirelog.errors import SetupError


@pytest.mark.parametrize(
    ("content", "said"), [(b"\xff\xfe\x00", "is not UTF-8"), (b"x" * (2 << 20), "larger than")]
)
def test_what_is_no_setup_at_all(tmp_path, content, said):
    (tmp_path / "s.toml").write_bytes(content)
    with pytest.raises(SetupError, match=said):
        load_setup(tmp_path / "s.toml")


def test_no_channels():
    with pytest.raises(SetupError, match="at least one"):
        parse_setup("[tire]\nname='x'\n")
