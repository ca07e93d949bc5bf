"""The two-link study, small: printed frequencies, and a verdict that is missed without dM/ds s''."""

import numpy as np
import pytest


@pytest.mark.slow
def test_two_link(study, pictures, tmp_path):
    module = study("two_link")
    result = module.main("small", tmp_path)
    np.testing.assert_allclose(result["shapes"], module.PRINTED, atol=0.005)
    assert result["coupled"].shape == (5, 4)
    whole, without, _ = result["sweeps"].values()
    assert whole.margin[0] < -whole.error[0]
    assert whole.margin[1] > whole.error[1]  # parametric resonance near 0.6 Hz ...
    assert without.margin[1] < -without.error[1]  # ... which a K_L without its first term does not see
    for label, data in result["sweeps"].items():
        np.testing.assert_array_equal(pictures.curves("two_link.svg", 1)[label], [data.frequency, data.margin])
    frequencies = [line.get_ydata() for line in pictures["two_link.svg"].axes[0].lines]
    np.testing.assert_array_equal(np.transpose(frequencies), result["coupled"])
