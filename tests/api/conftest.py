"""The small log of the command line's tests, and the command line itself as `command`."""

from tests.cli.conftest import folder as folder
from tests.cli.conftest import tirelog as command

__all__ = ["command", "folder"]
