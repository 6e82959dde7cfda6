"""Closed form: rates and periods in the words of a preamble; what is none of either."""

import pytest

from tirelog.readers.base import date_of, rate_in_words

LINES = {
    "Samples per Second\t1": 1.0,
    "Sampling rate: 2500 Hz": 2500.0,
    "Sampling Rate [Hz];100": 100.0,
    "Sample frequency (Hz) = 2,5": 2.5,
    "sampling rate of the device: 20 Hz": 20.0,
    "SampleRate=51.2 kHz": 51200.0,
    "fs = 1e3": 1000.0,
    "# Config: data_rate = 2000.0 Hz, filter = 488 Hz": 2000.0,
    "OutputRate:,120Hz,": 120.0,
    "Update Rate\t60.0Hz": 60.0,
    "bridge, sampled at 1024": 1024.0,
    "acquisition rate: 2 MHz": 2e6,
    "Scan rate,10 kS/s": 10_000.0,
    "Delta_X\t0.001000\t0.001000\t": 1000.0,
    "Delta_X\t0,5": 2.0,
    "dt = 10 ms": 100.0,
    "sampling interval: 250 us": 4000.0,
    "Sample period [s]: 0.02": 50.0,
    # none
    "Baud rate: 115200": None,
    "bit rate = 9600": None,
    "heart rate,72": None,
    "time,rate,CH1": None,
    "time_s,heart rate [bpm],CH 12": None,
    "Sampling rate: none": None,
    "Sampling rate: 0 Hz": None,
    "a width of 215": None,
    "audit 2026": None,
    "calibrate 5": None,
    "Sampling rate: 1.2.3": None,
}


@pytest.mark.parametrize("line", LINES)
def test_a_rate_in_words(line):
    assert rate_in_words(["Report 7", line]) == pytest.approx(LINES[line])


STAMPS = [(1.77e9, "s"), (1.77e12, "ms"), (1.77e15, "us"), (1.77e18, "ns")]
TICKS = [(134_144_736_000_000_000, "100ns"), (639_055_968_000_000_000, "100ns")]  # FILETIME, .NET


@pytest.mark.parametrize(("stamp", "unit"), [*STAMPS, *TICKS])
def test_the_date_of_a_stamp_by_its_size(stamp, unit):
    assert date_of(stamp, unit) == "2026-02-02T02:40:00+00:00"
    assert date_of(12.0, unit) is None
