"""Makes every log of sample_data anew from its scenario, with the seeds that stand there, and the
table of sha256 in the README.

python sample_data/make.py
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from tirelog.simulation import load_scenario, simulate, write_log

HERE = Path(__file__).parent

#: log -> scenario
LOGS = {
    "drive.csv.gz": "drive",
    "drive_messages.mcap": "drive",
    "encoder.h5": "encoder",
    "encoder_ramp.h5": "encoder_ramp",
    "encoder_front.h5": "encoder_front",
    "encoder_low.h5": "encoder_low",
    "inflation.csv.gz": "inflation",
    "hidden_1.csv.gz": "hidden_1",
    "hidden_2.csv.gz": "hidden_2",
    "unknown_1.csv.gz": "unknown_1",
    "unknown_2.csv.gz": "unknown_2",
    "cleat.csv.gz": "cleat",
}
_TABLE = re.compile(r"(<!-- sha256 -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    """Write the logs, their setups and truths, and the README's table."""
    rows = ["| file | bytes | sha256 |", "| --- | --- | --- |"]
    for log, scenario in LOGS.items():
        made = write_log(
            simulate(load_scenario(HERE / "scenarios" / f"{scenario}.toml")), HERE / log
        )
        for path in made:
            data = path.read_bytes()
            rows.append(f"| {path.name} | {len(data)} | `{hashlib.sha256(data).hexdigest()}` |")
    readme = HERE / "README.md"
    table = "\n".join(rows) + "\n"
    readme.write_text(
        _TABLE.sub(lambda found: found[1] + table + found[2], readme.read_text(encoding="utf-8")),
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
