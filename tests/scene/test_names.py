"""The names of the built-in scenes."""

import flexlin as fl
from flexlin.scene import builtin_scenes


def test_scenes_are_named_with_their_titles():
    assert fl.scenes() == {name: fl.load_scene(name).title for name in builtin_scenes()}
