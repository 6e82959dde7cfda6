"""How sphinx builds the site from the pages of this folder (`make docs`)."""

import re
from pathlib import Path

project = "tirelog"
author = "The tirelog authors"
copyright = "The tirelog authors"
release = re.findall(
    r'__version__ = "(.*)"', Path(__file__).parents[1].joinpath("tirelog/version.py").read_text()
)[0]
extensions = ["myst_parser"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"tirelog {release}"
html_show_sourcelink = False
html_copy_source = False
# pages that are read in the repository as well name files of it, which are no pages of the site
suppress_warnings = ["misc.highlighting_failure"]
