"""Effects that synthetic logs call for, found by forward selection."""

from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import main
from flexlin.errors import ArgumentError
from tests.identification.logs import simulated, swing
from tests.identification.test_maximum_likelihood import LOG, NOISE, SENSORS, is_near, noisy

FREE = ["effects.payload.mass", "links.0.bending_stiffness"]
FRICTIONS = ["viscous_friction", "coulomb_friction"]
TIME = np.arange(1800) * 0.005
TORQUE = 0.3 * swing(TIME)[0]


def scene_with(**effects):
    return fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "log": LOG, "effects": effects})


def log_of(scene, seed):
    return noisy(simulated(scene, TIME, lambda t: 0.3 * swing(t), SENSORS)[0], seed, NOISE, TIME, (TORQUE,))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coulomb", "viscous", "seed", "called_for"),
    [(None, None, 4, ()), (0.03, None, 4, ("coulomb_friction",)), (None, 0.05, 4, ("viscous_friction",)),
     (0.020033, None, 112, ("coulomb_friction",)), (0.03406, 0.02172, 111, ("coulomb_friction", "viscous_friction"))],
)  # fmt: skip
def test_the_effect_that_made_a_log_is_called_for_and_no_other(coulomb, viscous, seed, called_for):
    friction = {"torque": [coulomb], "rate": 0.1}, {"coefficient": [viscous]}
    effects = {name: friction[name == FRICTIONS[0]] for name in called_for}
    bare = {"payload": {"mass": 0.1}, "geometric_stiffening": {}}
    true = scene_with(**bare, **effects)
    found = fl.select_effects(scene_with(**bare), log_of(true, seed), FREE, FRICTIONS, window=1.0)
    assert found.effects == called_for
    assert is_near(found.identification, true)
    assert [trial.effect for trial in found.trials if trial.taken] == list(called_for)
    assert len(found.trials) == 2 + len(called_for)
    needless = found.status.partition("not needed: ")[2]
    assert all(name in needless for name in FRICTIONS if name not in called_for)


def test_effects_that_cannot_be_judged_are_refused_or_said_to_be_so(monkeypatch, tmp_path):
    scene = fl.load_scene("single-link", {"links.0.modes": 0, "log": LOG, "designs": []})
    log = fl.Log(TIME, {"q1": TORQUE}, {"q1": 0.1 * np.sin(TIME)})
    for name, how in (("friction", {}), ("payload", {}), ("shear", {"hold_back": 0.05})):
        with pytest.raises(ArgumentError):
            fl.select_effects(scene, log, FREE[:1], [name], **how)
    found = fl.select_effects(scene, log, FREE[:1], FRICTIONS, seconds=1e-3)
    assert all("time was used up" in trial.problem for trial in found.trials)
    assert found.status.startswith("no effect was judged; not judged: viscous_friction, coulomb_friction")
    settled = replace(found, identification=replace(found.identification, settled=True))
    monkeypatch.setattr(fl, "read_log", lambda *_: log, raising=False)
    monkeypatch.setattr(fl, "select_effects", lambda *_, **__: settled, raising=False)
    assert main(["identify", "single-link", "--log=x", f"--free={FREE[0]}", "--effects", "--out", str(tmp_path)]) == 4


@pytest.mark.slow
def test_slopes_of_friction_that_is_sharper_than_steps_give_no_errors():
    sharp = scene_with(payload={"mass": 0.1}, coulomb_friction={"torque": [0.03], "rate": 1e-6})
    log = log_of(scene_with(payload={"mass": 0.1}, coulomb_friction={"torque": [0.03], "rate": 1e-3}), 4)
    found = fl.identify(sharp, log, [*FREE, "effects.coulomb_friction.torque.0"], window=1.0, starts=1)
    assert "as slopes say" in found.status
    assert not np.isfinite(list(found.errors.values())).any()
