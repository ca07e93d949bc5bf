"""What others use for the same question: transition matrices of one period by SciPy, CasADi's cvodes and heyoka."""

from flexlin.answers.peers.integrators import prepare_cvodes, prepare_scipy
from flexlin.answers.peers.right_hand_sides import prepare_rate
from flexlin.answers.peers.taylor import HeyokaTransitions, import_heyoka

__all__ = ["HeyokaTransitions", "import_heyoka", "prepare_cvodes", "prepare_rate", "prepare_scipy"]
