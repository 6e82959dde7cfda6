"""Closed form: the tread that wears off a tire, fitted to its logs at several distances (P3)."""

from pathlib import Path

from tests.physics.commands import status
from tirelog.physics.model.file import load_model

SCENARIO = """
seed = {seed}
truth = "beam"
[tire]
lever_arm_m = 4e-3
[conditions]
load_N = 3434.0
distance_km = {distance}
[road]
roughness = 0.005
[channels.strain_1]
kind = "fbg_strain"
source = "CH1"
surface = "inner"
noise = 0.0008
[[effects]]
name = "wear"
amplitude = 0.0
lever_loss = 0.25
"""


def test_a_tread_s_loss_is_told_by_its_logs(tmp_path, monkeypatch):
    """A lever arm of 4 mm that loses a quarter in 40000 km is 2 mm of rubber of one material."""
    monkeypatch.chdir(tmp_path)
    drive = [(4, 10), (4, 16), (4, 16), (4, 9), (4, 9)]
    steps = "".join(f"[[manoeuvres]]\nduration_s = {t}\nspeed_m_s = {v}\n" for t, v in drive)
    for k, distance in enumerate((1e3, 1.4e4, 3e4)):
        Path("case.toml").write_text(SCENARIO.format(seed=50 + k, distance=distance) + steps)
        assert status(f"simulate case.toml -o log{k}.csv --quiet") == 0
    assert status("model new --setup log0.toml -o beam.toml --set lever_arm_m=0.003 --quiet") == 0
    assert status("model add beam.toml tread_depth -o worn.toml") == 0
    logs = "log0.csv log1.csv log2.csv"
    assert status(f"model fit {logs} --model worn.toml -o fitted.toml --quiet") == 0
    worn = load_model(Path("fitted.toml")).parameters["tread_depth.worn_mm"]
    assert worn.se is not None
    assert worn.se < 0.1
    assert abs(worn.value - 2.0) < 2.5 * worn.se
