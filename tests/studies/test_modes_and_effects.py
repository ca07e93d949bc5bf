"""The study of modes and effects, small: errors fall with modes, and the effects that matter are those of the audit."""

import pytest


@pytest.mark.slow
def test_modes_and_effects(study, pictures, tmp_path):
    rows = {row.version: row for row in study("modes_and_effects").main("small", tmp_path)}
    one, two = rows["1 modes"], rows["2 modes"]
    assert two.frequency < one.frequency / 10
    assert two.tip < one.tip
    assert one.instructions < two.instructions
    assert rows["without gravity"].tip > 0.1
    assert rows["without payload"].frequency > 0.1
    assert rows["without rotary_inertia"].frequency < 0.01
    assert {"without shear", "without geometric_stiffening", "without modal_damping"} <= set(rows)
    drawn = pictures.curves("modes_and_effects.svg")
    modes = [row for row in rows.values() if row.version.endswith("modes")]
    curve = next(points for label, points in drawn.items() if label.startswith("tip: modes 1 to"))
    assert curve.T.tolist() == [[row.instructions, row.tip] for row in modes]
    written = {text.get_text() for text in pictures["modes_and_effects.svg"].axes[0].texts}
    assert written == {row.version.removeprefix("without ") for row in rows.values() if "without" in row.version}
