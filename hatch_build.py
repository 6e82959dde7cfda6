"""Compiles the kernels while the package is installed.

Without a C compiler they are compiled when they are first called (docs/install.md says what that
costs). TIRELOG_REQUIRE_KERNELS=1 makes it an error: a wheel for others needs them.
"""

import compileall
import os
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class KernelsHook(BuildHookInterface):
    """A wheel, also that of an editable installation, gets `tirelog/kernels/_built`.

    The modules of an editable one are compiled as well: where Python keeps no bytecode
    (PYTHONDONTWRITEBYTECODE), every command would compile a hundred of them, which takes 0.2 s.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            return
        if version == "editable":  # of any other the installer compiles the modules, too
            compileall.compile_dir(Path(self.root, "tirelog"), quiet=2)
        sys.path.insert(0, self.root)
        try:
            from tirelog.kernels.build import build

            made = build()
        except Exception as problem:
            if os.environ.get("TIRELOG_REQUIRE_KERNELS"):
                raise
            self.app.display_warning(
                "kernels are not compiled now, so the first commands take half a minute longer; "
                f"install a C compiler, then tirelog again ({problem})"
            )
            return
        finally:
            sys.path.remove(self.root)
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
        build_data["artifacts"] += [path.relative_to(Path(self.root)).as_posix() for path in made]
