"""Runs the notebook, and writes its outputs into it and into its page of the site.

    python docs/notebook/run.py         (also: make outputs)

The cells are run in one namespace in this folder, and shown as a notebook does it. Cells with the
tag "stored" take too long for the tests, which run the others and compare; here all are run.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import re
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
NOTEBOOK = HERE / "first_hour.ipynb"
PAGE = NOTEBOOK.with_suffix(".md")
PICTURES = HERE.parent / "pictures"
#: the tag of a cell that only `main` runs
STORED = "stored"


def read() -> dict[str, Any]:
    """The notebook (nbformat 4)."""
    found: dict[str, Any] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    return found


def stored(cell: dict[str, Any]) -> bool:
    """True if the tests do not run the cell."""
    return STORED in cell["metadata"].get("tags", ())


def run(cells: list[dict[str, Any]]) -> tuple[list[list[dict[str, Any]]], dict[str, Any]]:
    """Outputs of code cells, run one after the other in this folder, and the names they made."""
    names: dict[str, Any] = {"__name__": "notebook"}
    with chdir(HERE):
        return [_run(cell, names) for cell in cells], names


def _run(cell: dict[str, Any], names: dict[str, Any]) -> list[dict[str, Any]]:
    """Outputs of one cell: what it prints, and its last value."""
    body = ast.parse("".join(cell["source"])).body
    last = body.pop() if body and isinstance(body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with redirect_stdout(printed):
        exec(compile(ast.Module(body, []), cell["id"], "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        lines = printed.getvalue().splitlines(keepends=True)
        outputs.append({"name": "stdout", "output_type": "stream", "text": lines})
    if value is not None:
        outputs.append(
            {
                "data": shown(value),
                "execution_count": None,
                "metadata": {},
                "output_type": "execute_result",
            }
        )
    if "matplotlib.pyplot" in sys.modules:  # which shows what it has drawn, and forgets it
        from matplotlib import pyplot

        for number in pyplot.get_fignums():
            made = io.BytesIO()
            pyplot.figure(number).savefig(made, format="png", dpi=72)
            data = {
                "image/png": base64.b64encode(_small(made.getvalue())).decode(),
                "text/plain": ["<Figure>"],
            }
            outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
        pyplot.close("all")
    return outputs


def shown(value: Any) -> dict[str, Any]:
    """A value in the forms that a notebook asks it for."""
    forms: dict[str, Any] = {}
    if hasattr(value, "_repr_png_"):
        forms["image/png"] = base64.b64encode(_small(value._repr_png_())).decode()
        return forms | {"text/plain": [f"<{type(value).__name__}>"]}
    html = value._repr_html_() if hasattr(value, "_repr_html_") else None
    if html is not None:
        forms["text/html"] = html.splitlines(keepends=True)
    return forms | {"text/plain": repr(value).splitlines(keepends=True)}


def _small(picture: bytes) -> bytes:
    """A PNG of 256 colours: half of the bytes, and no difference that is seen at this size."""
    from PIL import Image

    made = io.BytesIO()
    with Image.open(io.BytesIO(picture)) as image:
        image.convert("RGB").quantize(256).save(made, format="PNG", optimize=True)
    return made.getvalue()


def page(notebook: dict[str, Any]) -> tuple[str, dict[str, bytes]]:
    """The notebook as a page of the site, and its pictures by name."""
    parts, pictures = [], {}
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(text)
            continue
        parts.append(f"```py\n{text}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "text" in output:
                parts.append(f"```text\n{''.join(output['text'])}```")
            elif "image/png" in data:
                name = f"{NOTEBOOK.stem}_{len(pictures) + 1}.png"
                pictures[name] = base64.b64decode(data["image/png"])
                parts.append(f"![what the cell above draws](../pictures/{name})")
            elif "text/html" in data:
                html = re.sub(r"<style.*?</style>", "", "".join(data["text/html"]), flags=re.S)
                parts.append("\n".join(line for line in html.splitlines() if line.strip()))
            else:
                parts.append(f"```text\n{''.join(data['text/plain'])}\n```")
    made = "<!-- made by `make outputs` from first_hour.ipynb; change that file -->\n"
    return made + "\n\n".join(parts) + "\n", pictures


def main() -> None:
    """Run every cell, and write notebook, page and pictures."""
    notebook = read()
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    outputs, _ = run(cells)
    for number, (cell, made) in enumerate(zip(cells, outputs, strict=True), start=1):
        cell["outputs"], cell["execution_count"] = made, number
        for output in made:
            if "execution_count" in output:
                output["execution_count"] = number
    NOTEBOOK.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    text, pictures = page(notebook)
    PAGE.write_text(text, encoding="utf-8")
    for name, picture in pictures.items():
        (PICTURES / name).write_bytes(picture)


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    sys.path.insert(0, str(HERE.parents[1]))
    main()
