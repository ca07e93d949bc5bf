"""What others use for the same question: transition matrices of one period by SciPy, CasADi's cvodes and heyoka."""

from flexlin.answers.peers.integrators import cvodes_transition, scipy_transition
from flexlin.answers.peers.right_hand_sides import transition_rate
from flexlin.answers.peers.taylor import HeyokaTransitions, heyoka

__all__ = ["HeyokaTransitions", "cvodes_transition", "heyoka", "scipy_transition", "transition_rate"]
