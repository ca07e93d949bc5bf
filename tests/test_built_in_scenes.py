"""Built-in scenes without designs, with another number of modes on their first link: they take any, or say what to do."""

import pytest

import flexlin as fl

WITH_DESIGNS = [name for name in fl.scenes() if fl.load_scene(name).designs]
REFUSED = {
    "arm-on-carriage": r"no length and no mass per length, expected 0, since it cannot bend, or any number for links\.1\.modes",
    "manutec-r3": r"expected flexible\.NAME with a link's name in that file",
    "puma-560": "expected 0, since it cannot bend, or length and mass_per_length for the link",
    "rigid-flexible-forearm": r"links\.0\.bending_stiffness: got nothing, expected a positive number",
    "spatial-arm": r"or any number for links\.1\.modes or links\.2\.modes",
}


@pytest.mark.parametrize("name", sorted(set(fl.scenes()) - set(WITH_DESIGNS)))
def test_other_scenes_take_it_or_say_what_to_do(name):
    if name in REFUSED:
        with pytest.raises(fl.errors.SceneError, match=REFUSED[name]):
            fl.load_scene(name, {"links.0.modes": 5})
    else:
        assert fl.build_manipulator(fl.load_scene(name, {"links.0.modes": 5})).n >= 5


FOREARM = {"length": 0.3, "mass_per_length": 1.0, "bending_stiffness": 90.0, "modes": 5}


def test_what_a_refusal_says_helps():
    """The key that a message names, set to what it asks for, makes the scene whole."""
    for name, changes in (
        ("arm-on-carriage", {"links.1.modes": 5}),
        ("manutec-r3", {"flexible.link_2": {"bending_stiffness": 1e5, "modes": 5}}),
        ("rigid-flexible-forearm", {"links.0": FOREARM}),
        ("spatial-arm", {"links.2.modes": 5}),
    ):
        assert fl.build_manipulator(fl.load_scene(name, changes)).n >= 5
