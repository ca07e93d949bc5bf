"""What an effect may add to a chain; each method's default adds nothing."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Optional

import casadi as ca

from flexlin.mechanics.body import Body, Moments, RigidMass
from flexlin.mechanics.effects.narrow import Features, Moving
from flexlin.mechanics.effects.scale import Scale
from flexlin.mechanics.frames import Frame
from flexlin.scene.effects import EffectTable

if TYPE_CHECKING:
    from flexlin.mechanics.links import BentLink


@dataclass(frozen=True)
class Chain:
    """The chain as its kinematics left it.

    q, q_rate: the joints' displacements as their bearings see them, (joints, 1), in rad or m; motor, motor_rate: the same as the motors
    see them, behind any joint flexibility; a frame behind each joint; links; a frame at each link's tip; all bodies that have mass.
    """

    q: ca.SX
    q_rate: ca.SX
    motor: ca.SX
    motor_rate: ca.SX
    joints: tuple[Frame, ...]
    links: tuple["BentLink", ...]
    tips: tuple[Frame, ...]
    bodies: tuple[Body, ...] = ()


class Effect(EffectTable):
    """One physical effect: its keys in the scene, and what it adds to the chain when its table is there.

    The first sentence of a class says in reports what the effect is; a key's unit stands beside its type. A key's value may be a
    CasADi symbol in the place of its number.
    """

    smooth: ClassVar[bool] = False
    """Whether what the effect adds is as smooth in time as the motion is (sines and polynomials of it), or `features` says where not."""
    input_unit: ClassVar[str | None] = None
    """The unit of the manipulator's inputs, where the effect changes it."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["Effect"]:
        """The effect with figures for a scene that has none; None where it has nothing to act on, or nothing is known of its size."""
        return None

    def joint_radius(self, joint: int) -> Any:
        """Distance from the joint's axis to where its link begins, in m."""
        return 0.0

    def joint_body(self, joint: int) -> RigidMass | None:
        """The rigid body that the effect puts on a joint."""
        return None

    def tip_body(self, link: int, links: int) -> RigidMass | None:
        """The rigid body that the effect puts on the tip of one of the links."""
        return None

    def section_shear(self, link: int) -> Any:
        """Shear stiffness kappa G A of a link's sections, in N; None when the effect does not let them shear."""
        return None

    def section_gyration(self, link: int) -> Any:
        """Radius of gyration of a link's sections, in m."""
        return 0.0

    def tip_shortening(self, link: "BentLink") -> tuple[ca.SX, ca.SX]:
        """Displacement of the link's tip along the link, with its rate, in m and m/s."""
        return ca.SX(0), ca.SX(0)

    def link_moments(self, link: "BentLink") -> Moments | None:
        """What is added to the moments of a link."""
        return None

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        """Bodies added to the chain."""
        return ()

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        """Kinetic energy beside that of the bodies, in J."""
        return ca.SX(0)

    def potential_energy(self, chain: Chain) -> ca.SX:
        """Potential energy, in J; `chain.bodies` is complete here."""
        return ca.SX(0)

    def dissipation(self, chain: Chain) -> ca.SX:
        """Rayleigh's dissipation function, in W: the resisting force is its gradient by the rates."""
        return ca.SX(0)

    def joint_resistance(self, chain: Chain) -> ca.SX:
        """Resisting force of each joint's bearing that no quadratic dissipation function gives, (joints, 1), in N m or N."""
        return ca.SX.zeros(len(chain.joints))

    def features(self, motion: Moving) -> Features:
        """Where the linear equations change fast in time because of the effect: pairs (time, half-width) in s."""
        return ()

    def input_gain(self, joint: int) -> Any:
        """Force of a joint's motor for one unit of the input; None when the effect leaves the input as it is."""
        return None


def per_joint(value: Any, joint: int, *, single: str) -> Any:
    """Read a table's value for one joint: a tuple by index; a single number stands for the `"first"` joint or for `"every"` one."""
    if isinstance(value, tuple):
        return value[joint] if joint < len(value) else 0.0
    return value if single == "every" or joint == 0 else 0.0


def at_tip(value: Any, link: int, links: int) -> Any:
    """Read a table's value for the tip of one link: a tuple by index; a single number stands for the last link."""
    if isinstance(value, tuple):
        return value[link] if link < len(value) else 0.0
    return value if link == links - 1 else 0.0
