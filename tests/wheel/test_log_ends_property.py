"""Property: a log that ends sooner says the same of its last passage, or marks it."""

import shutil

import h5py
import pytest

import tirelog
from tests.sources import ROOT

SAMPLES = ROOT / "sample_data"


@pytest.fixture(scope="module")
def whole():
    return tirelog.phase_shift(SAMPLES / "encoder.h5")


@pytest.mark.parametrize("degrees", [25.0, 65.0, 100.0, 140.0])
def test_the_last_passage_of_a_log_that_ends_beside_it(whole, tmp_path, degrees):
    """Its level is from both sides of the patch: with one of them short, widths came out 1 degree
    off.
    """
    known, turn_s = whole.iloc[-2], whole.time_s.iloc[-1] - whole.time_s.iloc[-2]
    end_s = known.time_s + degrees / 360.0 * turn_s
    with h5py.File(SAMPLES / "encoder.h5") as log, h5py.File(tmp_path / "log.h5", "w") as cut:

        def copy(name, item):
            if isinstance(item, h5py.Dataset):
                rate_Hz = item.attrs.get("sampling_rate_Hz")
                data = item[: int(end_s * rate_Hz)] if rate_Hz is not None else item[()]
                cut.create_dataset(name, data=data).attrs.update(item.attrs)

        log.visititems(copy)
    shutil.copy(SAMPLES / "encoder.toml", tmp_path / "log.toml")
    last = tirelog.phase_shift(tmp_path / "log.h5").iloc[-1]
    assert last.time_s == pytest.approx(known.time_s, abs=1e-3)
    assert last.quality == ("ok" if degrees == 140.0 else "edge_of_log")
    if last.quality == "ok":
        assert last.patch_width_deg == pytest.approx(
            known.patch_width_deg, abs=known.patch_width_se_deg
        )
