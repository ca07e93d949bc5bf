"""The study of the paper's equations, small: identities to rounding, and the false divergence at the first frequency."""

import numpy as np
import pytest


@pytest.mark.slow
def test_khang_2019(study, pictures, tmp_path):
    result = study("khang_2019").main(size="small", out=tmp_path)
    assert result["difference"] < 1e-13
    paper, stiff = result["series"].values()
    for label, data in result["series"].items():
        np.testing.assert_array_equal(pictures.curves("khang_2019.svg", 0)[label], [data.ratio, data.stiffness])
        np.testing.assert_array_equal(pictures.curves("khang_2019.svg", 1)[label], [data.ratio, data.margin])
    assert np.all(np.diff(paper.stiffness) < 0)
    assert np.all(np.diff(stiff.stiffness) > 0)
    assert set(stiff.verdicts) == {"stable"}
    fast = paper.ratio > 1.0
    assert {verdict for verdict, over in zip(paper.verdicts, fast, strict=True) if over} == {"unstable"}
    assert {verdict for verdict, over in zip(paper.verdicts, fast, strict=True) if not over} == {"stable"}
