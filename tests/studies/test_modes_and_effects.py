"""The study of modes and effects, small: errors fall with modes, and the effects that matter are those of the audit."""


def test_modes_and_effects(study, tmp_path):
    rows = {row.version: row for row in study("modes_and_effects").main("small", tmp_path)}
    one, two = rows["1 modes"], rows["2 modes"]
    assert two.frequency < one.frequency / 10
    assert two.tip < one.tip
    assert one.instructions < two.instructions
    assert rows["without gravity"].tip > 0.1
    assert rows["without payload"].frequency > 0.1
    assert rows["without rotary_inertia"].frequency < 0.01
    assert {"without shear", "without geometric_stiffening", "without modal_damping"} <= set(rows)
    assert (tmp_path / "modes_and_effects.svg").stat().st_size > 1000
