"""Property: `model new --preset` starts from a paper's table; a setup and --set go before it."""

from tirelog.physics.model.file import load_model, preset_model


def test_a_preset_is_written_as_it_is_with_its_sources(folder, tirelog):
    for name in ("P1", "P2", "P3"):
        outcome = tirelog("model", "new", "--preset", name, "-o", f"{name}.toml").ended(0)
        assert "a guess" not in outcome.err
        read = load_model(f"{name}.toml")
        assert (read.values, read.free) == (preset_model(name).values, preset_model(name).free)
        assert "Table" in (folder / f"{name}.toml").read_text()


def test_a_setup_goes_before_a_preset_and_set_before_both(folder, tirelog):
    line = ["model", "new", "--preset", "P2", "--setup", "log.toml", "-o", "m.toml"]
    assert tirelog(*line).status == 0
    assert load_model("m.toml").values["radius_m"] == 0.305
    assert load_model("m.toml").values["foundation_stiffness_N_m2"] == 7.79e6
    assert tirelog(*line, "--set", "radius_m=0.31").status == 0
    assert load_model("m.toml").values["radius_m"] == 0.31


def test_a_preset_of_another_carcass_is_refused(folder, tirelog):
    tirelog("model", "new", "--preset", "P1", "--carcass", "ring", "-o", "m.toml").refused("a beam")
    assert not (folder / "m.toml").exists()
