"""Property: nobody is sent to a workshop by the misfit of a model."""

import numpy as np
import pytest

import tirelog
from tests.diagnosis.planted import MODEL, ringing, stack
from tirelog.data.recording import Conditions
from tirelog.inference.measured import MeasuredLogs

_LOAD_N = 3434.0


def force(share):
    """A load that varies by so much with the wheel's angle, three times a turn."""

    def added(xi, speed):
        phi = xi[0] / 0.3
        loads = [
            MODEL.predict(
                Conditions.of(len(xi), speed_m_s=speed[:, 0], acceleration_m_s2=0.0, time_s=0.0,
                              load_N=_LOAD_N * factor),
                phi,
            )
            for factor in (1.01, 0.99)
        ]  # fmt: skip
        return share * np.sin(3.0 * phi) * (loads[0] - loads[1]) / 0.02

    return added


def notes(*planted):
    """(verdict, what is said of the wheel) of revolutions with all of it planted."""
    measured = MeasuredLogs(
        [stack(lambda xi, speed: sum(one(xi, speed) for one in planted), manoeuvres=11, m=64)]
    )
    found = tirelog.diagnose(measured, MODEL.with_nuisance("wheel", "on"))
    (said,) = [note for note in found.notes if "force variation at" in note]
    return found.verdict, said


def test_a_wheel_out_of_balance_is_to_be_balanced():
    verdict, said = notes(force(0.025))
    assert verdict == "nothing_missing"
    assert "balance the wheel" in said
    assert "no finding" not in said


@pytest.mark.parametrize(
    ("planted", "why"),
    [((force(0.025), ringing), "the model leaves a rest"), ((force(0.08),), "ordinary size")],
)
def test_what_may_be_misfit_is_no_finding(planted, why):
    _, said = notes(*planted)
    assert "no finding" in said
    assert why in said
    assert "balance the wheel" not in said
