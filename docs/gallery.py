"""docs/gallery.md: the figures and tables of the four papers, redrawn by tirelog's own commands.

    python docs/gallery.py              writes the page and its pictures (also: make gallery)

Every number on the page is read from a table that a command wrote, in a scratch copy of
sample_data; the papers' own numbers, and those of docs/errata.md, stand here. Pictures are drawn
from the same tables. Logs that no sample holds are simulated on the way (sample_data/scenarios).
"""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

import tirelog
from tirelog.cli import run
from tirelog.plots.record import figure_page

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURES = ROOT / "docs" / "gallery.md", ROOT / "docs" / "pictures" / "gallery"
#: pixels per inch of a picture of 10 inches: as wide as a page, some 50 kB
DPI = 88
NOTE = "<!-- made by `make gallery` from docs/gallery.py; change that file -->"


@dataclass
class Shown:
    """A figure or table of a paper as the page shows it.

    `rows`: what, the paper's number, tirelog's, why they differ ("" if they do not).
    """

    title: str
    text: str = ""
    pictures: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    rows: list[tuple[str, str, str, str]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def row(self, what: str, paper: str, own: str, why: str = "") -> None:
        self.rows.append((what, paper, own, why))

    def markdown(self) -> str:
        parts = [f"### {self.title}", self.text]
        if self.commands:
            parts.append("```text\n" + "\n".join(self.commands) + "\n```")
        parts += ["```text\n" + said + "\n```" for said in self.said]
        parts += [f"![{self.title}](pictures/gallery/{name})" for name in self.pictures]
        if self.rows:
            head = [("", "paper", "tirelog", "why they differ"), ("---",) * 4]
            parts.append("\n".join(f"| {' | '.join(cells)} |" for cells in [*head, *self.rows]))
        return "\n\n".join(part for part in parts if part)


class Lab:
    """A scratch folder in which commands are given, each shown on the page."""

    def __init__(self, shown: Shown) -> None:
        self.shown = shown

    def __call__(self, line: str) -> str:
        """What a command prints; a failure ends the script."""
        if line not in self.shown.commands:
            self.shown.commands.append(line)
        told, said = io.StringIO(), io.StringIO()
        with redirect_stdout(told), redirect_stderr(said):
            status = run(shlex.split(line)[1:])
        if status != 0:
            sys.exit(f"{line}\n{said.getvalue()}\nstatus {status}")
        return told.getvalue()

    def table(self, line: str) -> pd.DataFrame:
        """The table that a command with -o FILE.csv writes."""
        self(line)
        return pd.read_csv(re.search(r"-o (\S+\.csv)", line)[1])  # type: ignore[index]


def page(rows: int = 1, columns: int = 1, height: float = 3.0) -> tuple[Any, Any]:
    """A picture of so many panels."""
    figure = figure_page(10.0, height * rows)
    return figure, figure.subplots(rows, columns, squeeze=False)


def label(axes: Any, x: str, y: str, title: str = "", **limits: Any) -> None:
    """Axis labels, a title at the left, a faint grid."""
    axes.set(xlabel=x, ylabel=y, **limits)
    if title:
        axes.set_title(title, loc="left", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.6)


def write(figure: Any, shown: Shown, name: str) -> None:
    """The picture as a small file with a palette of 128 colours."""
    from PIL import Image

    PICTURES.mkdir(exist_ok=True)
    figure.savefig(PICTURES / name, dpi=DPI)
    with Image.open(PICTURES / name) as picture:
        picture.convert("RGB").quantize(128).save(PICTURES / name, optimize=True)
    shown.pictures.append(name)


def near(table: pd.DataFrame, reach_m: float = 0.25) -> pd.DataFrame:
    """The rows around the patch."""
    return table[table.xi_m.abs() < reach_m]


def at_peak(table: pd.DataFrame, column: str, largest: bool = True) -> float:
    """Where a column is largest (or least) [m], by the parabola through three points."""
    y = table[column].to_numpy() * (1.0 if largest else -1.0)
    i, x = int(y.argmax()), table.xi_m.to_numpy()
    bend = y[i - 1] - 2.0 * y[i] + y[i + 1]
    return float(x[i] + 0.5 * (y[i - 1] - y[i + 1]) / bend * (x[1] - x[0]))


# ---- P1


def p1_table_1() -> Shown:
    shown = Shown("P1 and P2 Table 1, and what follows from it: (2) to (5)")
    lab = Lab(shown)
    lab("tirelog model new --preset P1 --observable strain -o p1.toml --quiet")
    text = lab("tirelog model show p1.toml")
    shown.said.append(text[text.index("from these numbers") :].rstrip())
    facts = {
        w[0]: float(w[1])
        for w in map(str.split, text.splitlines())
        if len(w) > 2 and w[0] in ("lambda", "w_0", "critical_speed", "alpha")
    }
    printed = 2.0 * facts["lambda"] * np.sqrt(0.83 / 1100.0)
    shown.row(
        "critical speed (5)",
        f"{printed:.2f} m/s with the printed mu = 1100 kg/m",
        f"{facts['critical_speed']:.1f} m/s",
        "1100 is the rubber's density; mu is 0.676 kg/m (errata)",
    )
    shown.row(
        "alpha at the table's 11.11 m/s (4)",
        f"{11.11 / printed:.1f} (printed mu), where (9) is imaginary",
        f"{11.11 * facts['alpha']:.3f}",
        "as above; (4) is printed upside down",
    )
    return shown


def light_damping(s: Any, alpha: float, beta: float) -> Any:
    """P1 (7) to (9), over w_0; s > 0 ahead of the load."""
    b = np.sqrt(1.0 - alpha**2)
    a = [np.sqrt(1.0 + alpha**2 + sign * 2.0 * alpha * beta / b) for sign in (1.0, -1.0)]
    apart = 0.25 * (a[0] ** 2 - a[1] ** 2)
    sides = []
    for one, d_even, way in ((a[0], b**2 - apart, 1.0), (a[1], b**2 + apart, -1.0)):
        d_odd, x = one * b, way * s
        wave = d_odd * np.cos(one * x) + d_even * np.sin(one * x)
        sides.append(2.0 / (one * (d_odd**2 + d_even**2)) * np.exp(-b * np.abs(x)) * wave)
    return np.where(s >= 0.0, sides[0], sides[1])


def p1_fig_5() -> Shown:
    shown = Shown(
        "P1 Fig. 5: a point load with and without damping",
        "beta = 0.05 at 11.11 m/s. The difference is odd but for a small part, as (13) says; (12) "
        "as printed misses it by more than its size, as corrected it does not.",
    )
    lab = Lab(shown)
    lab("tirelog model new --preset P1 --observable strain --contact point -o point.toml --quiet")
    lab("tirelog model add point.toml viscous_damping --set damping_rate_1_s=169.73 -o damped.toml")
    plain, damped = (
        lab.table(f"tirelog model predict {n}.toml --speed 11.11 --points 8192 -o {n}.csv")
        for n in ("point", "damped")
    )
    forces = lab.table("tirelog model forces damped.toml --speed 11.11 -o damped_forces.csv")
    alpha, beta = forces.speed_ratio[0], forces.damping_ratio[0]
    wave, w_0 = 39.1381, 0.00985738
    s = wave * plain.xi_m.to_numpy()
    a, b = np.sqrt(1.0 + alpha**2), np.sqrt(1.0 - alpha**2)
    decay = np.exp(-b * np.abs(s)) / (a * b)
    undamped = decay * (a * np.cos(a * s) + b * np.sin(a * np.abs(s)))
    other = (1.0 + b * np.abs(s)) / b * decay * (b * np.cos(a * s) - a * np.sin(a * np.abs(s)))
    size = alpha * beta / (a * b)
    # (11), (12) count s ahead of the load, xi grows with the passing tread
    psi = {sign: np.sign(s) * (undamped / a + sign * other) for sign in (1.0, -1.0)}
    difference = (damped.displacement_m - plain.displacement_m).to_numpy() / w_0
    light = light_damping(-s, alpha, beta)
    shown.row(
        "light damping (7) to (9), largest difference over w_0",
        "0 for small beta",
        f"{np.abs(damped.displacement_m / w_0 - light).max():.1e}",
        "they hold to beta^2, the roots exactly (errata)",
    )
    even = 0.5 * (difference + difference[::-1])
    misses = {k: np.abs(difference - size * v).max() for k, v in psi.items()}
    shown.row(
        "undamped (10), largest difference over w_0",
        "closed form",
        f"{np.abs(plain.displacement_m / w_0 - undamped).max():.1e}",
        "1024 waves of a closed tread",
    )
    shown.row("size of the difference over w_0", "small", f"{np.abs(difference).max():.2e}")
    shown.row("its even part over w_0", "none", f"{np.abs(even).max():.1e}", "of order beta^2")
    shown.row("missed by (12) as printed", "0", f"{misses[1.0]:.1e}", "a sign (errata)")
    shown.row("missed by (12) as corrected", "", f"{misses[-1.0]:.1e}")
    figure, ((left, right),) = page(1, 2)
    for table, name in ((plain, "undamped"), (damped, "damped")):
        part = near(table)
        left.plot(1e3 * part.xi_m, part.displacement_m / w_0, label=name)
    label(left, "ξ [mm]", "deflection over w₀", "P1 Fig. 5")
    left.legend(fontsize=8)
    inside = np.abs(plain.xi_m) < 0.25
    x = 1e3 * plain.xi_m[inside]
    right.plot(x, difference[inside], label="damped less undamped")
    right.plot(x, size * psi[-1.0][inside], "--", label="ε ψ of (12), corrected")
    right.plot(x, size * psi[1.0][inside], ":", label="ε ψ of (12), printed")
    label(right, "ξ [mm]", "over w₀")
    right.legend(fontsize=8)
    write(figure, shown, "p1_fig_5.png")
    return shown


def p1_figs_7_to_11() -> Shown:
    shown = Shown(
        "P1 Figs. 7 to 11: strain, speed, specific power and dissipation factor",
        "A simulated drive (`sample_data/scenarios/falling_factor.toml`): P1's beam whose belt "
        "grows taut with the square of the speed. Its factor falls, as P1 measured; that of P1's "
        "own model rises, and so does that of its log (`scenarios/rising_factor.toml`). So the "
        "model fails on the measurement, `diagnose` says by what, and with that effect the fitted "
        "model has the trend. The effect's equation is shared by truth and model; P1's tire may "
        "have had another reason.",
    )
    lab = Lab(shown)
    lab("tirelog simulate scenarios/falling_factor.toml -o falling.csv.gz --quiet")
    lab("tirelog dissipation falling.csv.gz -o factor.csv --plot p1_figs_7_to_11.png --quiet")
    steady = lab.table("tirelog dissipation falling.csv.gz -o steady.csv --quiet")
    lab("tirelog simulate scenarios/rising_factor.toml -o rising.csv.gz --quiet")
    risen = lab.table("tirelog dissipation rising.csv.gz -o risen.csv --quiet")
    lab("tirelog dissipation falling.csv.gz --fit -o fits.json --quiet")
    fits = json.loads(Path("fits.json").read_text())
    slopes = {row["quantity"]: row for row in fits}
    lab("tirelog model new --preset P1 --observable strain --setup falling.toml -o p1.toml --quiet")
    lab("tirelog model fit falling.csv.gz --model p1.toml -o p1_fitted.toml --quiet")
    told = lab("tirelog diagnose falling.csv.gz --model p1.toml --quiet")
    verdict = json.loads(
        lab("tirelog diagnose falling.csv.gz --model p1.toml --format json --quiet")
    )
    shown.said.append("\n".join(told.splitlines()[:5]))
    lab("tirelog model add p1.toml belt_tension -o p1_taut.toml")
    lab("tirelog model fit falling.csv.gz --model p1_taut.toml -o p1_taut_fitted.toml --quiet")
    fitted = {n: tirelog.load_model(f"{n}.toml") for n in ("p1_fitted", "p1_taut_fitted")}
    preset = tirelog.load_model("p1.toml")
    speeds = np.linspace(3.0, 24.0, 22)

    def factor(model: Any) -> Any:
        return tirelog.predict(model, {"speed_m_s": speeds}, observable="dissipation_factor")[:, 0]

    # cleanly measured revolutions alone
    clean, other = (
        t[t.steady & (t.quality == "ok") & (t.speed_m_s > 4.0)].sort_values("speed_m_s")
        for t in (steady, risen)
    )
    (slow, fast), (low, high) = (
        [
            float(table.dissipation_factor_1_m[(table.speed_m_s - v).abs() < 0.5].median())
            for v in (5.0, 24.0)
        ]
        for table in (clean, other)
    )
    own = factor(preset)
    shown.row(
        "factor over speed, measured",
        "falls almost linearly",
        f"falls: {fast / slow:.2f} times from 5 to 24 m/s",
    )
    shown.row(
        "the same of P1's own beam, measured",
        "",
        f"rises: {high / low:.2f} times from 5 to 24 m/s",
        "nothing is planted; the other sign of the trend",
    )
    shown.row(
        "specific power over speed, measured",
        "rises, nearly linear",
        f"rises, {slopes['specific_power_m3_s2']['slope']:.2e} +- "
        f"{slopes['specific_power_m3_s2']['slope_se']:.0e} m^2/s per m/s",
    )
    shown.row(
        "factor of P1's own model from 3 to 24 m/s",
        "",
        f"rises: {own[-1] / own[0]:.3f} times",
        "P1's model fails on P1's Fig. 11 (errata: 1.145)",
    )
    shown.row(
        "what is missing",
        "",
        f"{', '.join(verdict['selected'])} ({verdict['verdict']}), error "
        f"{1e6 * verdict['rmse_heldout_before']:.0f} -> "
        f"{1e6 * verdict['rmse_heldout_after']:.0f} microstrain, floor "
        f"{1e6 * verdict['noise_floor']:.0f}",
    )
    after = factor(fitted["p1_taut_fitted"])
    shown.row(
        "factor of the fitted model with it, 5 to 24 m/s",
        "",
        f"falls: {after[-1] / np.interp(5.0, speeds, after):.2f} times",
    )
    figure, ((left, right),) = page(1, 2, 3.4)
    left.plot(clean.speed_m_s, clean.dissipation_factor_mean_1_m, ".", ms=3, label="measured")
    left.plot(speeds, factor(fitted["p1_fitted"]), "--", label="P1's model, fitted")
    left.plot(speeds, after, label="with belt_tension, fitted")
    label(left, "speed [m/s]", "dissipation factor [1/m]", "P1 Fig. 11")
    left.legend(fontsize=8)
    right.plot(clean.speed_m_s, clean.specific_power_mean_m3_s2, ".", ms=3)
    label(right, "speed [m/s]", "specific power [m³/s²]")
    write(figure, shown, "p1_fig_11.png")
    return shown


def p1_resistance() -> Shown:
    shown = Shown(
        "P1 3.2 and (22) to (27): the torque on the wheel, and where the power goes",
        "A damped beam takes power from the road; over the wheel's speed it is the moment that the "
        "pressure, heavier towards the entry edge, has. What is undamped takes none: the kinetic "
        "and elastic terms of (24), (25) return. A belt with its own viscosity (22) takes what the "
        "bending term of (25) says.",
    )
    lab = Lab(shown)
    lab("tirelog model new --preset P1 --observable strain -o p1.toml --quiet")
    lab("tirelog model add p1.toml viscous_damping --set damping_rate_1_s=169.73 -o lossy.toml")
    lab("tirelog model add p1.toml belt_viscosity --set retardation_s=2e-5 -o kelvin.toml")
    tables = {
        name: lab.table(
            f"tirelog model forces {name}.toml --speed 3:24:3 --load 2000,4000 -o {name}_f.csv"
        )
        for name in ("p1", "lossy", "kelvin")
    }
    heavy = {name: t[t.load_N == 4000.0] for name, t in tables.items()}
    rest = abs(heavy["p1"].dissipated_power_W.iloc[-1]) / (4000.0 * 24.0)
    shown.row(
        "power of the undamped beam at 24 m/s",
        "0 (24), (25)",
        f"below {max(rest, 1e-15):.0e} of load times speed",
    )
    ratio = tables["lossy"].groupby("load_N").rolling_resistance_N.last()
    shown.row(
        "rolling resistance, 4000 N over 2000 N, 24 m/s",
        "grows with load (P3)",
        f"{ratio[4000.0] / ratio[2000.0]:.2f} times",
        "P1 (16) to (20): power over speed",
    )
    moment = heavy["lossy"].rolling_resistance_moment_N_m.iloc[-1]
    shown.row("moment on the wheel at 24 m/s", "not given", f"{moment:.2f} N m")
    figure, ((axes,),) = page(1, 1)
    for name, what in (("lossy", "damped foundation, β = 0.05"), ("kelvin", "viscous belt (22)")):
        for load, table in tables[name].groupby("load_N"):
            axes.plot(table.speed_m_s, table.rolling_resistance_N, label=f"{what}, {load:.0f} N")
    label(axes, "speed [m/s]", "rolling resistance [N]")
    axes.legend(fontsize=8)
    write(figure, shown, "p1_resistance.png")
    return shown


# ---- P2


def p2_brush() -> Shown:
    shown = Shown("P2 Fig. 10, (13) to (17): pressure and traction at slip 0.15")
    lab = Lab(shown)
    lab("tirelog model new --preset P2 -o p2.toml --quiet")
    lab("tirelog model add p2.toml traction --set lever_m=0.018 -o brush.toml")
    table = lab.table(
        "tirelog model predict brush.toml --speed 11.11 --slip 0.15 --points 8192 -o fig10.csv"
    )
    forces = lab.table("tirelog model forces brush.toml --speed 11.11 --slip 0.15 -o f10.csv")
    share = forces.adhesion_share[0]
    x = table.xi_m.to_numpy()
    stick = (x > -0.03) & (x < 0.02)
    stiffness = np.polyfit(x[stick], table.shear_traction_N_m[stick], 1)[0] / 0.15
    shown.row("x_s (15)", "35.0 mm", f"{1e3 * (share - 0.5) * forces.patch_length_m[0]:.1f} mm")
    shown.row("C_x (17)", "1.88e6 N/m (sic)", f"{stiffness:.4g} N/m^2", "unit (errata)")
    shown.row("braking force", "", f"{forces.road_longitudinal_N[0]:.0f} N, adhering {share:.2f}")
    figure, ((axes,),) = page(1, 1)
    part = near(table, 0.07)
    axes.plot(1e3 * part.xi_m, 1e-3 * part.contact_pressure_N_m, label="pressure")
    axes.plot(1e3 * part.xi_m, 1e-3 * part.shear_traction_N_m, label="traction")
    label(axes, "ξ [mm], entry left", "[kN/m]", "P2 Fig. 10")
    axes.legend(fontsize=8)
    write(figure, shown, "p2_fig_10.png")
    return shown


def p2_figs_11_to_14() -> Shown:
    shown = Shown(
        "P2 Figs. 11 to 14: displacement, strain and its derivatives under slip",
        "The first derivative's extrema lie inside the patch; the second's at its edges only in "
        "free rolling, under slip one of them marks the onset (errata).",
    )
    lab = Lab(shown)
    table = lab.table(
        "tirelog model predict brush.toml --speed 11.11 --slip 0,0.05,0.15,0.3,0.5 "
        "--points 8192 -o fig13.csv"
    )
    by_slip = {float(slip): near(t, 0.15) for slip, t in table.groupby("slip")}
    free, braked = by_slip[0.0], by_slip[0.15]
    for slip, name in ((0.0, "free rolling"), (0.15, "slip 0.15")):
        deepest = 1e3 * by_slip[slip].displacement_m.max()
        shown.row(
            f"largest displacement, {name}",
            '"roughly 0.8 cm"' if slip else "",
            f"{deepest:.2f} mm",
            "mu corrected (errata)" if slip else "",
        )
    edges = [1e3 * at_peak(free, "strain_slope_1_m", up) for up in (False, True)]
    shown.row(
        "extrema of the first derivative",
        "inside the edges at 50 mm",
        f"{edges[0]:.1f} and {edges[1]:.1f} mm",
    )
    inner = free[free.xi_m.abs() < 0.06]
    second = [
        1e3 * at_peak(inner[np.sign(inner.xi_m) == side], "strain_curvature_1_m2", False)
        for side in (-1.0, 1.0)
    ]
    shown.row(
        "extrema of the second, free (Fig. 14)",
        "at the edges",
        f"{second[0]:.1f} and {second[1]:.1f} mm",
    )
    behind = braked[(braked.xi_m > 0.0) & (braked.xi_m < 0.07)]
    onset = behind.xi_m.iloc[int(np.argmax(np.abs(np.gradient(behind.strain_slope_1_m))))]
    shown.row(
        "kink of the slope at slip 0.15",
        "the onset, 35.0 mm",
        f"{1e3 * onset:.1f} mm",
        "not the edge: P2 3.2 holds without slip (errata)",
    )
    for column, name, up in (("displacement_m", "displacement", True), ("strain", "strain", False)):
        places = ", ".join(
            f"{1e3 * at_peak(by_slip[s], column, up):.1f}" for s in (0.05, 0.15, 0.3, 0.5)
        )
        shown.row(
            f"largest {name} at slip 0.05, 0.15, 0.3, 0.5",
            "moves to the leading edge" if not up else "",
            f"{places} mm",
            "the strain's only beyond 0.15 (errata)" if not up else "",
        )
    figure, panels = page(2, 3, 2.7)
    for slip, t in by_slip.items():
        for axes, column, what in zip(
            panels.ravel(),
            ("displacement_m", "strain", "strain_slope_1_m", "strain_curvature_1_m2"),
            ("displacement [m]", "strain", "strain's slope [1/m]", "second derivative [1/m²]"),
            strict=False,
        ):
            axes.plot(1e3 * t.xi_m, t[column], lw=1.0, label=f"slip {slip:g}")
            label(axes, "ξ [mm]", what)
    panels[1, 0].set_ylim(-60.0, 60.0)  # waves end at the 1024th: the jump at the onset rings
    panels[0, 0].legend(fontsize=7)
    for axes, column in zip(panels[1, 1:], ("displacement_m", "strain"), strict=True):
        axes.plot(1e3 * free.xi_m, free[column], label="vertical")
        axes.plot(1e3 * free.xi_m, braked[column].to_numpy() - free[column], label="frictional")
        axes.plot(1e3 * free.xi_m, braked[column], "k", lw=0.8, label="both")
        label(axes, "ξ [mm]", column, "P2 Fig. 12, slip 0.15")
        axes.legend(fontsize=7)
    write(figure, shown, "p2_figs_11_to_14.png")
    return shown


def p2_inflation() -> Shown:
    shown = Shown("P2 Figs. 15 and 16: strain while inflating, with two stops")
    lab = Lab(shown)
    table = lab.table("tirelog inflation inflation.csv.gz -o inflation_table.csv --quiet")
    truth = json.loads(Path("inflation.csv.gz.truth.json").read_text())
    slope = float(table.strain_slope_1_Pa.dropna().iloc[0])
    error = float(table.strain_slope_se_1_Pa.dropna().iloc[0])
    leaky = table[table.leak.fillna(0.0) != 0.0]
    leaks, leak_error = 1e6 * leaky.leak.abs(), 1e6 * leaky.leak_se.max()
    shown.row(
        "strain over pressure",
        "grows linearly",
        f"{1e11 * slope:.1f} +- {1e11 * error:.1f} microstrain/bar, straight to "
        f"{100 * float(table.nonlinearity.dropna().iloc[0]):.1f} %",
    )
    ramp = truth["ramp"]
    planted = 1e6 * ramp["leak_Pa"] * ramp["strain_per_Pa"]
    shown.row(
        "leaks at the two stops",
        "two",
        " and ".join(f"{x:.1f}" for x in leaks) + f" microstrain, each +- {leak_error:.1f}",
        f"planted {planted:.1f}",
    )
    # a thin ring: hoop force p b R, so strain = p b R / (E A)
    shown.row(
        "extensional stiffness that this slope means, b = 0.14 m, R = 0.305 m",
        "not given",
        f"E A = p b R / strain = {0.14 * 0.305 / slope / 1e6:.1f} MN",
    )
    return shown


def p2_figs_17_to_19() -> Shown:
    shown = Shown(
        "P2 Figs. 17 to 19: the onset of slip under drive and brake torque",
        "Two simulated drives with traction: `sample_data/scenarios/slip_onset.toml`, friction 0.8 "
        "and 0.6, 3.3 m/s^2 up and 4.3 m/s^2 down, and `low_grip.toml`, half as hard on a road of "
        "0.3 and 0.2. What of the patch adheres is P2's measure of the grip that is left; the "
        "friction itself has to be given.",
    )
    lab = Lab(shown)
    figure, panels = page(1, 3)
    for log, title, column, ratio, options in (
        ("slip_onset", "friction 0.8", 1, 1.0, ""),
        (
            "low_grip",
            "friction 0.3",
            2,
            2.667,
            "--static-friction 0.3 --sliding-friction 0.2 --stiffness-ratio 2.667 ",
        ),
    ):
        lab(f"tirelog simulate scenarios/{log}.toml -o {log}.csv.gz --quiet")
        table = lab.table(f"tirelog grip {log}.csv.gz {options}-o {log}_grip.csv --quiet")
        truth = json.loads(Path(f"{log}.csv.gz.truth.json").read_text())["motion"]
        acceleration = np.interp(table.time_s, truth["time_s"], truth["acceleration_m_s2"])
        share = np.maximum(1.0 - 0.4 * ratio * np.abs(acceleration) / 9.81, 0.0)
        found = table.adhesion_share.notna()
        for torque, name in ((acceleration > 1.0, "drive"), (acceleration < -1.0, "brake")):
            rows = found & torque
            if rows.any():
                off = table.adhesion_share[rows] - share[rows]
                shown.row(
                    f"{title}, {name}: share that adheres",
                    "read off Fig. 18 or 19",
                    f"{table.adhesion_share[rows].median():.3f}, truth "
                    f"{np.median(share[rows]):.3f} ({int(rows.sum())} of {int(torque.sum())} "
                    f"passages tell one, {100 * off.median():+.1f} % of the patch)",
                )
        calm = np.abs(acceleration) < 0.3
        shown.row(
            f"{title}: passages without torque that show one",
            "none",
            f"{int((found & calm).sum())} of {int(calm.sum())}",
        )
        axes, order = panels[0, column], np.argsort(table.time_s)
        axes.plot(table.time_s[order], share[order], lw=0.8, label="truth")
        axes.errorbar(
            table.time_s,
            table.adhesion_share,
            table.adhesion_share_se,
            fmt=".",
            ms=4,
            label="measured",
        )
        label(axes, "time [s]", "share of the patch that adheres", f"P2 Figs. 18, 19: {title}")
        axes.legend(fontsize=8)
    speed = lab.table("tirelog speed slip_onset.csv.gz -o slip_onset_speed.csv --quiet")
    panels[0, 0].plot(speed.time_s, speed.speed_m_s, ".", ms=2)
    label(panels[0, 0], "time [s]", "speed [m/s]", "P2 Fig. 17")
    write(figure, shown, "p2_figs_17_to_19.png")
    return shown


def p2_footprint() -> Shown:
    shown = Shown(
        "P2 Figs. 19 to 22: the dynamic footprint by first and second derivative",
        "Simulated with Table 1's beam and the measured L = 63 mm "
        "(`sample_data/scenarios/coasting.toml`), read off with the papers' 300 Hz low-pass.",
    )
    lab = Lab(shown)
    lab("tirelog simulate scenarios/coasting.toml -o coasting.csv.gz --quiet")
    plain = lab.table("tirelog footprint coasting.csv.gz --cutoff 300Hz -o fig21.csv --quiet")
    forty = lab.table("tirelog footprint coasting.csv.gz --cutoff 40x -o fig21_40x.csv --quiet")

    def median(table: pd.DataFrame, speed: float, column: str) -> float:
        rows = (table.quality == "ok") & ((table.speed_m_s - speed).abs() < 0.1)
        return 1e2 * float(table[column][rows].median())

    shown.row(
        "Fig. 21, 13.5 km/h, second derivative",
        "12 +- 0.4 cm",
        f"{median(plain, 3.75, 'length_d2_m'):.1f} cm",
        "whole-millisecond stamps",
    )
    shown.row(
        "Fig. 21, first derivative", "9.3 +- 0.4 cm", f"{median(plain, 3.75, 'length_d1_m'):.1f} cm"
    )
    shown.row(
        "Fig. 19, 45 km/h, first derivative",
        "8.7 +- 1.3 cm",
        f"{median(plain, 12.5, 'length_d1_m'):.1f} cm",
    )
    shown.row(
        "best estimate (truth 12.6 cm)",
        "static footprint 12.6 cm",
        f"{median(plain, 3.75, 'length_m'):.2f} and {median(plain, 12.5, 'length_m'):.2f} cm",
    )
    shown.row(
        "second derivative at 40 x the wheel frequency",
        "used at 70 km/h",
        f"{median(forty, 3.75, 'length_d2_m'):.1f} and {median(forty, 12.5, 'length_d2_m'):.1f} cm",
        "40 x is a fixed 49 mm (errata)",
    )
    lab("tirelog footprint coasting.csv.gz --cutoff 300Hz -o fig21.csv --plot p2_figs_20_to_22.png")
    return shown


# ---- P3


def p3_modes() -> Shown:
    shown = Shown("P3 Fig. 3: strain with 10 and with 100 modes, 1000 N")
    lab = Lab(shown)
    lab("tirelog model new --preset P3 -o p3.toml --quiet")
    tables = {
        n: lab.table(
            f"tirelog model predict p3.toml --speed 10 --modes {n} --surface inner -o m{n}.csv"
        )
        for n in (10, 100, 1023)
    }
    whole = tables[1023].strain.max()
    for n in (10, 100):
        missed = (tables[n].strain - tables[1023].strain)[tables[n].phi_deg.abs() > 30.0]
        shown.row(
            f"{n} modes",
            "rings visibly" if n == 10 else "does not",
            f"{100 * tables[n].strain.max() / whole:.1f} % of the peak, ringing "
            f"of {1e6 * missed.abs().max():.1f} microstrain beside the patch",
        )
    shown.row(
        "peak",
        "at the patch centre, tensile",
        f"{whole:.4f} at {tables[1023].phi_deg[tables[1023].strain.idxmax()]:.1f} deg",
    )
    figure, panels = page(1, 2)
    for axes, reach in zip(panels[0], (180.0, 25.0), strict=True):
        for n, table in tables.items():
            part = table[table.phi_deg.abs() < reach]
            axes.plot(part.phi_deg, part.strain, lw=1.0, label=f"{n} modes")
        label(axes, "φ [deg]", "strain", "P3 Fig. 3")
    panels[0, 0].legend(fontsize=8)
    write(figure, shown, "p3_fig_3.png")
    return shown


def p3_slip_and_hub() -> Shown:
    shown = Shown("P3 Fig. 4 and F_x*, F_z*: longitudinal slip at 250 N, and the forces on the hub")
    lab = Lab(shown)
    lab("tirelog model add p3.toml traction --set lever_m=0 -o p3_slip.toml")
    table = lab.table(
        "tirelog model predict p3_slip.toml --speed 10 --load 250 --slip=-0.2,0,0.2 "
        "--surface inner --points 4096 -o fig4.csv"
    )
    forces = lab.table(
        "tirelog model forces p3_slip.toml --speed 10 --load 250,1000 --slip 0,0.2 -o hub.csv"
    )
    for _, row in forces.iterrows():
        shown.row(
            f"(F_x*, F_z*) at {row.load_N:.0f} N, slip {row.slip:g}",
            "(-500, 500) at 1000 N as printed" if (row.load_N, row.slip) == (1000.0, 0.0) else "",
            f"({row.hub_longitudinal_N + 0.0:.1f}, {row.hub_vertical_N:.1f}) N",
            "k_v w printed twice (errata)" if (row.load_N, row.slip) == (1000.0, 0.0) else "",
        )
    for slip, part in table.groupby("slip"):
        lobes = [part.strain[np.sign(part.phi_deg) == side].min() for side in (-1.0, 1.0)]
        shown.row(
            f"lower lobes at slip {slip:g}",
            "unequal with slip" if slip else "equal",
            f"{lobes[0]:.5f}, {lobes[1]:.5f}",
            "P3's eps_x > 0 drives: about minus the slip" if slip > 0 else "",
        )
    figure, ((axes,),) = page(1, 1)
    for slip, part in table.groupby("slip"):
        part = part[part.phi_deg.abs() < 30.0]
        axes.plot(part.phi_deg, part.strain, lw=1.0, label=f"slip {slip:g} (braking positive)")
    label(axes, "φ [deg]", "strain", "P3 Fig. 4, 250 N")
    axes.legend(fontsize=8)
    write(figure, shown, "p3_fig_4.png")
    return shown


def p3_wear() -> Shown:
    shown = Shown(
        "P3 Figs. 5 and 6: wear",
        "P3 gives no equation. Here the tread is a block of rubber: stiffness as 1/depth, the "
        "neutral axis nearer to the liner by half of what is worn off; 8 mm new. Less mass does "
        "nothing to a steady strain.",
    )
    lab = Lab(shown)
    tables = {}
    for depth in (8, 5, 2):
        lab(
            f"tirelog model worn p3_slip.toml --new-depth 0.008 --depth {depth / 1000:g} "
            f"-o worn{depth}.toml --quiet"
        )
        for modes in (10, 100):
            tables[depth, modes] = lab.table(
                f"tirelog model predict worn{depth}.toml --speed 10 --slip=-0.05 --modes {modes} "
                f"--surface inner -o worn{depth}_{modes}.csv"
            )
    for depth in (8, 5, 2):
        shown.row(
            f"largest strain at {depth} mm of tread, 100 modes",
            "differs with wear",
            f"{tables[depth, 100].strain.max():.5f}",
            "mostly the shorter lever arm" if depth == 2 else "",
        )
    figure, panels = page(1, 2)
    for axes, modes in zip(panels[0], (10, 100), strict=True):
        for depth in (8, 5, 2):
            part = tables[depth, modes]
            part = part[part.phi_deg.abs() < 60.0]
            axes.plot(part.phi_deg, part.strain, lw=1.0, label=f"{depth} mm of tread")
        label(axes, "φ [deg]", "strain", f"P3 Fig. {5 if modes == 10 else 6}: {modes} modes")
    panels[0, 0].legend(fontsize=8)
    write(figure, shown, "p3_figs_5_6.png")
    return shown


def p3_loads() -> Shown:
    shown = Shown(
        "P3 Fig. 7: deformation under three loads",
        "P3 finds less deformation and more asymmetry at a higher load. The ring, derived anew and "
        "checked against finite elements (errata), does the contrary: it is pressed in more, and "
        "stays even. The figure cannot be had from P3's own equations.",
    )
    lab = Lab(shown)
    table = lab.table("tirelog model predict p3.toml --speed 10 --load 250,1000,3500 -o fig7.csv")
    paper = {250.0: "most", 1000.0: "less", 3500.0: "least, asymmetric"}
    for load, part in table.groupby("load_N"):
        w = part.displacement_m.to_numpy()
        odd = np.abs(w - w[::-1]).max() / w.max()
        shown.row(
            f"{load:.0f} N",
            paper[float(load)],
            f"{1e3 * w.max():.2f} mm, odd part {odd:.0e} of it",
            "contradiction",
        )
    figure, panels = page(1, 2)
    for axes, column, factor, what in (
        (panels[0, 0], "displacement_m", 1e3, "inward [mm]"),
        (panels[0, 1], "tangential_displacement_m", 1e3, "along the belt [mm]"),
    ):
        for load, part in table.groupby("load_N"):
            axes.plot(part.phi_deg, factor * part[column], lw=1.0, label=f"{load:.0f} N")
        label(axes, "φ [deg]", what, "P3 Fig. 7")
    panels[0, 0].legend(fontsize=8)
    write(figure, shown, "p3_fig_7.png")
    return shown


def p3_table_2() -> Shown:
    shown = Shown(
        "P3 Table 2: natural frequencies of the coupled ring, 0 to 300 Hz, lateral force",
        "Slip angle and camber act on the brush alone (the ring is stiff sideways).",
    )
    lab = Lab(shown)
    lab("tirelog model modes p3.toml --speed 20 -o modes.csv")
    modes = pd.read_csv("modes.csv")
    air = modes[(modes.support == "air") & (modes.frequency_Hz < 140)]
    for _, row in air.iterrows():
        shown.row(f"{row['shape']}, {row.direction}", "", f"{row.frequency_Hz:.1f} Hz")
    across = lab.table(
        "tirelog model forces p3.toml --speed 10 --load 1000,2000,3500 --slip-angle 2 -o fy.csv"
    )
    for _, row in across.iterrows():
        shown.row(
            f"slip angle 2 deg, {row.load_N:.0f} N",
            "named in Table 1",
            f"F_y {row.road_lateral_N:.0f} N, M_z {row.aligning_moment_N_m:.1f} N m",
        )
    return shown


# ---- P4


def p4_signals() -> Shown:
    shown = Shown("P4 Figs. 4 to 6: encoder, speed at the contact point, wheel angle")
    lab = Lab(shown)
    PICTURES.mkdir(exist_ok=True)
    table = lab.table(
        "tirelog wheel-angle encoder.h5 --from 14 --to 14.1 -o angle.csv --quiet "
        "--plot p4_figs_4_to_6.png"
    )
    teeth = int((np.diff(np.sign(table.encoder_signal - table.encoder_signal.median())) > 0).sum())
    turn = np.unwrap(np.radians(table.turned_deg))
    shown.row(
        "periods in 100 ms",
        "48 a turn",
        f"{teeth} in {np.degrees(turn[-1] - turn[0]):.0f} deg, "
        f"{360.0 * teeth / np.degrees(turn[-1] - turn[0]):.1f} a turn",
    )
    shown.row("speed", "20 Hz low-pass", f"{table.speed_m_s.mean():.2f} m/s at a planted 22 m/s")
    return shown


def p4_experiment() -> Shown:
    shown = Shown(
        "P4 Figs. 2 and 7 to 13: phase shift and width of the patch",
        "Rear (driven) and front wheel of one simulated car at 2.0 bar, the rear one also at 1.6 "
        "bar by the same calibration; maps learnt on the ramp from 10 to 24 m/s. The paper's eight "
        "statements of section V are the signs below.",
    )
    lab = Lab(shown)
    lab(
        "tirelog phase-shift encoder_ramp.h5 encoder_front.h5 --calibrate wheel.toml -o ramp.csv "
        "--quiet"
    )
    tables = {
        name: lab.table(
            f"tirelog phase-shift encoder{log}.h5 --calibration wheel.toml -o {name}.csv --quiet"
        )
        for name, log in (("rear", ""), ("front", "_front"), ("low", "_low"))
    }
    speeds = {
        name: lab.table(f"tirelog speed encoder{log}.h5 -o {name}_speed.csv --quiet")
        for name, log in (("rear", ""), ("front", "_front"), ("low", "_low"))
    }
    signs = {
        ("rear", "drive"): ("> 0", "wider"),
        ("front", "drive"): ("0", "narrower"),
        ("rear", "brake"): ("< 0", "narrower"),
        ("front", "brake"): ("< 0", "wider"),
    }
    for name, what in (("rear", "rear"), ("front", "front"), ("low", "rear at 1.6 bar")):
        table = tables[name][tables[name].quality.isin(["ok", "delay_removed"])]
        pace = np.interp(table.time_s, speeds[name].time_s, speeds[name].acceleration_m_s2)
        calm = np.abs(pace) < 0.2
        width = table.patch_width_detrended_deg
        corrected = table.phase_shift_corrected_deg
        shift = corrected if corrected.notna().any() else table.phase_shift_detrended_deg
        shown.row(
            f"{what}, constant speed",
            "shift 0, one width (25 deg at 2.0 bar)",
            f"shift {shift[calm].mean():+.3f}, width {width[calm].median():.2f} deg",
            "another tire: the width is its own" if name == "rear" else "",
        )
        for phase, rows in (("drive", pace > 1.0), ("brake", pace < -1.0)):
            paper = signs[("rear" if name == "low" else name, phase)]
            shown.row(
                f"{what}, {phase}",
                f"shift {paper[0]}, {paper[1]}",
                f"shift {shift[rows].median():+.2f} deg, width "
                f"{width[rows].median() - width[calm].median():+.2f} deg",
                "printed with the wrong sign (errata)" * ((name, phase) == ("rear", "brake")),
            )
    figure, panels = page(2, 3, 2.5)
    for column, (name, title) in enumerate(
        (("rear", "rear, Fig. 12 (a)"), ("front", "front, Fig. 12 (b)"), ("low", "1.6 bar"))
    ):
        table = tables[name]
        panels[0, column].plot(table.time_s, table.phase_shift_corrected_deg, ".", ms=2)
        if not table.phase_shift_corrected_deg.notna().any():
            panels[0, column].plot(table.time_s, table.phase_shift_detrended_deg, ".", ms=2)
        panels[1, column].plot(table.time_s, table.patch_width_detrended_deg, ".", ms=2)
        label(panels[0, column], "time [s]", "phase shift [deg]", title)
        label(panels[1, column], "time [s]", "width [deg]")
    write(figure, shown, "p4_figs_10_to_13.png")
    lab(
        "tirelog phase-shift encoder.h5 --calibration wheel.toml -o rear.csv --plot p4_figs_7_8.png"
    )
    return shown


SECTIONS: Sequence[tuple[str, Sequence[Callable[[], Shown]]]] = (
    ("P1: rolling resistance", (p1_table_1, p1_fig_5, p1_figs_7_to_11, p1_resistance)),
    (
        "P2: contact patch",
        (p2_brush, p2_figs_11_to_14, p2_inflation, p2_figs_17_to_19, p2_footprint),
    ),
    ("P3: flexible ring", (p3_modes, p3_slip_and_hub, p3_wear, p3_loads, p3_table_2)),
    ("P4: phase shift", (p4_signals, p4_experiment)),
)
HEAD = f"""{NOTE}
# Gallery: the papers' figures, redrawn

Each figure and table of the four papers that can be computed, by tirelog's commands, beside the
paper's number and the reason where the two differ ([errata](errata.md)). The papers' copies at hand
hold no pictures, so that figures are compared by what their captions and text say. All logs are
simulated. Not here are photographs and set-ups (P1 Figs. 1 to 4 and 6, P2 Figs. 1 to 9, P3 Figs. 1
and 2, P4 Figs. 1 and 3). What is implemented, equation by equation: [papers](papers.md).
"""


def main() -> None:
    """Write the page and its pictures."""
    os.environ["COLUMNS"] = "100"
    parts = [HEAD]
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "sample_data"
        shutil.copytree(ROOT / "sample_data", folder)
        with chdir(folder):
            for title, figures in SECTIONS:
                parts.append(f"## {title}\n")
                for make in figures:
                    shown = make()
                    for drawn in re.findall(r"--plot (\S+)", " ".join(shown.commands)):
                        small(Path(drawn), PICTURES / drawn)
                        shown.pictures.append(drawn)
                    parts.append(shown.markdown() + "\n")
                    sys.stderr.write(f"{shown.title}\n")
    PAGE.write_text("\n".join(parts), encoding="utf-8")


def small(source: Path, target: Path) -> None:
    """A picture that a command drew, 900 pixels wide."""
    from PIL import Image

    with Image.open(source) as picture:
        less = picture.convert("RGB")
        less = less.resize((900, round(less.height * 900 / less.width)))
        less.quantize(128).save(target, optimize=True)


if __name__ == "__main__":
    main()
