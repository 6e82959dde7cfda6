"""Outputs and pictures that README.md and the pages show, made by running their commands.

    python docs/outputs.py              writes them (also: make outputs)

A `console` block holds lines "$ command" with what each printed below it. They are run in the order
of `PAGES` in one copy of sample_data, each different command once, and the block is written anew. A
`python` block that writes a picture is run there too. A picture that a page shows
(`![...](pictures/NAME.png)`) is the NAME.png that one of them wrote, made small, or the first
screen of the NAME.html that one of them wrote. The sketch of the tire is drawn, the notebook is
run, and its page made.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "docs/tour.md",
    "docs/missing_effect.md",
    "docs/moving.md",
    "docs/slides.md",
    "docs/methods/*.md",
)
CONSOLE = re.compile(r"(^```console\n)(.*?)(^```$)", re.M | re.S)
DRAWS = re.compile(r"^```python\n((?:(?!^```).)*?savefig.*?)^```", re.M | re.S)
SHOWN = re.compile(r"!\[[^]]*\]\((?:docs/|\.\./)?pictures/([\w.]+\.png)\)")
#: a screen's width of a page [px]; larger pictures are made so wide
WIDEST_PX = 1000
#: width and height of a screen that shows the verdict of a report and its first figures [px]
SCREEN_PX = 1200, 1130


def pages() -> list[Path]:
    """The pages in the order in which their commands are run."""
    return [path for pattern in PAGES for path in sorted(ROOT.glob(pattern))]


def main() -> None:
    """Run every command once and write the pages and pictures."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "sample_data"
        shutil.copytree(ROOT / "sample_data", folder)
        printed: dict[str, str] = {}
        for page in pages():
            text = page.read_text(encoding="utf-8")
            new = CONSOLE.sub(
                lambda block: block[1] + run(block[2], folder, printed) + block[3], text
            )
            page.write_text(new, encoding="utf-8")
            for code in DRAWS.findall(text):
                execute([sys.executable, "-c", code], folder)
        execute([sys.executable, str(ROOT / "docs" / "sketch.py"), "tire.png"], folder)
        for name in dict.fromkeys(n for page in pages() for n in SHOWN.findall(page.read_text())):
            if not (folder / name).exists():
                photograph((folder / name).with_suffix(".html"), folder / name)
            shrink(folder / name, ROOT / "docs" / "pictures" / name)
    execute([sys.executable, str(ROOT / "docs" / "notebook" / "run.py")], ROOT)


def run(block: str, folder: Path, printed: dict[str, str]) -> str:
    """A block with what its commands print now."""
    lines = []
    for line in block.splitlines():
        if not line.startswith("$ "):
            continue
        command = line[2:]
        if command not in printed and not command.startswith("cd "):
            printed[command] = execute(
                ["bash", "-c", f"set -o pipefail; {{ {command}; }} 2>&1"], folder
            )
        lines += [line, *printed.get(command, "").splitlines()]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def execute(command: list[str], folder: Path) -> str:
    """What a command prints; a failure ends the script."""
    done = subprocess.run(
        command,
        cwd=folder,
        env={
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "COLUMNS": "100",
            "MPLBACKEND": "Agg",
        },
        text=True,
        capture_output=True,
        check=False,
    )
    if done.returncode not in (0, 141):  # 141: `head` left, which is no error
        sys.exit(f"{command[-1]}\n{done.stdout}{done.stderr}\nstatus {done.returncode}")
    return done.stdout


def photograph(page: Path, picture: Path) -> None:
    """The first screen of a page, by the Chromium that the tests of the report need too."""
    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--disable-gpu", "--no-first-run"]
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = playwright.chromium.launch(executable_path=path, args=flags, timeout=240_000)
        shown = browser.new_page(viewport=dict(zip(("width", "height"), SCREEN_PX)))
        shown.goto(page.as_uri(), timeout=240_000)
        shown.screenshot(path=picture)
        browser.close()


def shrink(source: Path, target: Path) -> None:
    """A picture with fewer pixels."""
    from PIL import Image

    with Image.open(source) as picture:
        small = picture.convert("RGB")
        if small.width > WIDEST_PX:
            small = small.resize((WIDEST_PX, round(small.height * WIDEST_PX / small.width)))
        target.parent.mkdir(exist_ok=True)
        small.save(target, optimize=True)  # no palette: it would change a map's colours


if __name__ == "__main__":
    main()
