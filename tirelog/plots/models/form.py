"""The picture of a tire's form: pressure over the patch, stiffness over wavelength."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tirelog.diagnosis.form import FormProfile, TireForm
from tirelog.plots.style import COLOURS, figure_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure(form: TireForm) -> Figure:
    """A matplotlib figure of both, each beside what the model's formulas give."""
    canvas = figure_page(9.5, 4.0)
    over_patch(canvas.add_subplot(1, 2, 1), form)
    axes, formula = canvas.add_subplot(1, 2, 2), form.stiffness.formula
    ratio = [x / formula for x in (form.stiffness.value, form.stiffness.se, formula)]
    _draw(axes, FormProfile(form.stiffness.at, *ratio), 1e3, 1.0)
    axes.set(xscale="log", xlabel="wavelength (mm)", ylabel="stiffness over the formula's")
    return canvas


def over_patch(axes: Axes, form: TireForm) -> None:
    """The contact pressure per length of the patch, entry edge to the left."""
    _draw(axes, form.pressure, 1e3, 1e-3)
    axes.set(xlabel="place in the patch, entry to exit (mm)", ylabel="contact pressure (N/mm)")
    axes.set_title(f"{form.load_N:.0f} N, {form.speed_m_s:.1f} m/s", loc="left", fontsize=10)
    axes.legend(fontsize=8)


def _draw(axes: Axes, profile: FormProfile, of_place: float, of_value: float) -> None:
    """A profile with a band of two standard errors."""
    at, value, se = profile.at * of_place, profile.value * of_value, profile.se * of_value
    axes.fill_between(at, value - 2 * se, value + 2 * se, color=COLOURS[0], alpha=0.25, lw=0)
    axes.plot(at, value, color=COLOURS[0], label="this tire, ± 2 standard errors")
    axes.plot(at, profile.formula * of_value, "--", color=COLOURS[5], label="the model's formula")
