"""What an effect may add to a chain and to its parts; each method's default adds nothing."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Optional

import casadi as ca

from flexlin.mechanics.body import Body, Frame, InertiaForm, Moments, RigidMass, Z
from flexlin.mechanics.effects.narrow import Features, Moving
from flexlin.mechanics.links import BentLink
from flexlin.scene.effects import Effects, EffectTable
from flexlin.scene.links import Link

SLENDERNESS = 0.01
"""Radius of gyration of a section, relative to the link's length."""
LOSS = 0.01
"""Damping ratios, and friction relative to the inertia forces of the motion."""


@dataclass(frozen=True)
class Scale:
    """The sizes of an arm, stretched out and at rest.

    links: their tables; inertias: about the joint of each link, the largest where it is fixed (kg m^2); mass: of the links (kg);
    motion: frequency of the basic motion (rad/s);
    bending: slowest frequency of a link clamped alone (rad/s), None where no link bends.
    """

    links: tuple[Link, ...]
    inertias: tuple[float, ...]
    mass: float
    motion: float
    bending: float | None

    @property
    def fast(self) -> float:
        """Five times as fast as the slowest link, or fifty times as fast as a rigid arm's motion (rad/s)."""
        return 50 * self.motion if self.bending is None else 5 * self.bending

    def of_inertias(self, factor: float) -> tuple[float, ...]:
        """Each joint's inertia times a factor."""
        return tuple(factor * inertia for inertia in self.inertias)


@dataclass(frozen=True)
class Chain:
    """The chain as its kinematics left it.

    q, q_rate: the displacements of the joints that move as their bearings see them, (joints, 1), in rad or m; motor, motor_rate: the
    same as the motors see them, behind any joint flexibility; moving: the number of the link behind each of these joints. For each link:
    the frame before its joint, the joint's axis (3, 1), the frame behind it, the link, the frame at its tip, the number of the link that
    carries it, -1 for the ground, what its bearing gives, (2, 1) or nothing, with the rates. All bodies that have mass, and as forms
    those of links that bend far; the symbols of the basic motion's phase t/T, and of the rates that loads from outside depend on.
    """

    q: ca.SX
    q_rate: ca.SX
    motor: ca.SX
    motor_rate: ca.SX
    moving: tuple[int, ...]
    mounts: tuple[Frame, ...]
    axes: tuple[ca.SX, ...]
    joints: tuple[Frame, ...]
    links: tuple[BentLink, ...]
    tips: tuple[Frame, ...]
    bearings: tuple[ca.SX, ...] = ()
    bearing_rates: tuple[ca.SX, ...] = ()
    bodies: tuple[Body, ...] = ()
    masses: tuple[InertiaForm, ...] = ()
    parents: tuple[int, ...] = ()
    phase: ca.SX = field(default_factory=lambda: ca.SX.sym("phase"))
    seen_rate: ca.SX = field(default_factory=lambda: ca.SX.sym("seen_rate"))


class Effect(EffectTable):
    """One physical effect: its keys in the scene, and what it adds to the chain when its table is there.

    The first sentence of a class says in reports what the effect is; a key's unit stands beside its type. A key's value may be a
    CasADi symbol in the place of its number. Each method of this class adds nothing: a subclass overrides what it needs.

    Attributes
    ----------
    input_unit : str or None
        The unit of the manipulator's inputs, where the effect changes it.

    See Also
    --------
    flexlin.mechanics.register_effect : Makes a subclass known to scenes.

    Examples
    --------
    >>> import casadi as ca
    >>> from flexlin.mechanics import Effect
    >>> class Spring(Effect):
    ...     "A spring at the first joint."
    ...     stiffness: float
    ...     def potential_energy(self, chain):
    ...         return self.stiffness * chain.q[0] ** 2 / 2
    >>> Spring(stiffness=2.0).joint_radius(0)
    0.0
    """

    smooth: ClassVar[bool] = False
    """Whether what the effect adds is as smooth in time as the motion is (sines and polynomials of it), or `features` says where not."""
    of_curve: ClassVar[bool] = False
    """Whether what the effect says of a bent link is the second order of what its curve says at any deflection."""
    input_unit: ClassVar[str | None] = None
    """The unit of the manipulator's inputs, where the effect changes it."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["Effect"]:
        """Return the effect with figures for a scene that has none.

        Parameters
        ----------
        scale : Scale
            Lengths, masses and frequencies of the scene.

        Returns
        -------
        Effect or None
            None where it has nothing to act on, or nothing is known of its size.
        """
        return None

    def frees_motor(self, joint: int) -> bool:
        """Return whether the effect gives a joint's motor a coordinate of its own.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        bool
            By default what the class says of all; 0 in a list of stiffnesses holds a joint.
        """
        return self.frees_motors and self._is_soft(joint)

    def frees_bearing(self, joint: int) -> bool:
        """Return whether the effect lets a joint's bearing give across its direction, by two coordinates.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        bool
            By default what the class says of all; 0 in a list of stiffnesses holds a joint.
        """
        return self.frees_bearings and self._is_soft(joint)

    def _is_soft(self, joint: int) -> bool:
        stiffness = per_joint(getattr(self, "stiffness", None), joint)
        return not isinstance(stiffness, int | float) or stiffness > 0

    def joint_radius(self, joint: int) -> Any:
        """Return the distance from a joint's axis to where its link begins.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        float or casadi.SX
            The distance, in m.
        """
        return 0.0

    def joint_body(self, joint: int) -> RigidMass | None:
        """Return the rigid body that the effect puts on a joint.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        RigidMass or None
            Mass in kg, inertia in kg m^2 and place in m.
        """
        return None

    def tip_body(self, link: int, links: int) -> RigidMass | None:
        """Return the rigid body that the effect puts on the tip of a link.

        Parameters
        ----------
        link : int
            Number of the link, from 0.
        links : int
            How many links there are.

        Returns
        -------
        RigidMass or None
            Mass in kg, inertia in kg m^2 and place in m.
        """
        return None

    def section_shear(self, link: int) -> Any:
        """Return the shear stiffness kappa G A of a link's sections.

        Parameters
        ----------
        link : int
            Number of the link, from 0.

        Returns
        -------
        float, profile or None
            The stiffness in N; None when the effect does not let the sections shear.
        """
        return None

    def section_gyration(self, link: int) -> Any:
        """Return the radius of gyration of a link's sections.

        Parameters
        ----------
        link : int
            Number of the link, from 0.

        Returns
        -------
        float or profile
            The radius, in m.
        """
        return 0.0

    def section_inertia(self, link: BentLink) -> tuple[Any, Any, Any] | None:
        """Return the inertia of a link's sections about their principal axes x, y and z.

        Parameters
        ----------
        link : BentLink
            The link.

        Returns
        -------
        tuple of float or casadi.SX, or None
            Of the whole link, in kg m^2.
        """
        return None

    def tip_displacement(self, link: BentLink) -> tuple[ca.SX, ca.SX]:
        """Return the displacement of a link's tip beside that of its modes.

        Parameters
        ----------
        link : BentLink
            The link with its elastic coordinates.

        Returns
        -------
        displacement : casadi.SX, shape (3, 1)
            In the link's axes, in m.
        rate : casadi.SX, shape (3, 1)
            Its rate, in m/s.
        """
        return ca.SX(3, 1), ca.SX(3, 1)

    def tip_turn(self, link: BentLink) -> tuple[ca.SX, ca.SX]:
        """Return the rotation of a link's tip beside that of its modes.

        Parameters
        ----------
        link : BentLink
            The link with its elastic coordinates.

        Returns
        -------
        rotation : casadi.SX, shape (3, 1)
            Rotation vector in the link's axes, in rad.
        rate : casadi.SX, shape (3, 1)
            Its rate, in rad/s.
        """
        return ca.SX(3, 1), ca.SX(3, 1)

    def link_moments(self, link: BentLink) -> Moments | None:
        """Return what is added to the moments of a link.

        Parameters
        ----------
        link : BentLink
            The link with its elastic coordinates.

        Returns
        -------
        Moments or None
            Mass, first and second moment with their rates.
        """
        return None

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        """Return the bodies that are added to the chain, by default those on its joints and at its tips.

        Parameters
        ----------
        chain : Chain
            The chain as its kinematics left it.

        Returns
        -------
        tuple of Body
            Frames with moments.
        """
        n = len(chain.links)
        places = zip((*chain.joints, *chain.tips), (*chain.axes, *[Z] * n), strict=True)
        carried = [*(self.joint_body(i) for i in range(n)), *(self.tip_body(i, n) for i in range(n))]
        found = [(body, place) for body, place in zip(carried, places, strict=True) if body is not None]
        return tuple(body.carried_by(*place) for body, place in found if not body.is_nothing)

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        """Return the kinetic energy beside that of the bodies.

        Parameters
        ----------
        chain : Chain
            The chain.

        Returns
        -------
        casadi.SX
            The energy, in J.
        """
        return ca.SX(0)

    def potential_energy(self, chain: Chain) -> ca.SX:
        """Return the potential energy of the effect.

        Parameters
        ----------
        chain : Chain
            The chain; its `bodies` are complete here.

        Returns
        -------
        casadi.SX
            The energy, in J.
        """
        return ca.SX(0)

    def dissipation(self, chain: Chain) -> ca.SX:
        """Return Rayleigh's dissipation function: the resisting force is its gradient by the rates.

        Parameters
        ----------
        chain : Chain
            The chain.

        Returns
        -------
        casadi.SX
            The function, in W.
        """
        return ca.SX(0)

    def joint_resistance(self, chain: Chain) -> ca.SX:
        """Return the resisting force of each joint's bearing that no quadratic dissipation function gives.

        Parameters
        ----------
        chain : Chain
            The chain.

        Returns
        -------
        casadi.SX, shape (joints, 1)
            The forces, in N m or N.
        """
        return ca.SX.zeros(len(chain.moving))

    def motor_resistance(self, chain: Chain) -> ca.SX:
        """Return the resisting force of each motor that no quadratic dissipation function gives.

        Parameters
        ----------
        chain : Chain
            The chain.

        Returns
        -------
        casadi.SX, shape (joints, 1)
            The forces, in N m or N.
        """
        return ca.SX.zeros(len(chain.moving))

    def power(self, chain: Chain) -> ca.SX:
        """Return the power of forces from outside: its gradient by the rates are the generalized forces.

        Parameters
        ----------
        chain : Chain
            The chain.

        Returns
        -------
        casadi.SX
            The power, in W, linear in the rates; it may hold the chain's phase, and `seen_rate` in the place of the first joint's rate.
        """
        return ca.SX(0)

    def features(self, motion: Moving) -> Features:
        """Return where the linear equations change fast in time because of the effect.

        Parameters
        ----------
        motion : Moving
            Angles and rates of the joints along the motion, by time.

        Returns
        -------
        tuple of (float, float)
            Pairs (time, half-width) in s.
        """
        return ()

    def input_gain(self, joint: int) -> Any:
        """Return the force of a joint's motor for one unit of the input.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        float, casadi.SX or None
            The force in N m or N; None when the effect leaves the input as it is.
        """
        return None


def effects_of(tables: Effects) -> tuple[Effect, ...]:
    """The effects that a scene calls for."""
    return tuple(effect for effect in tables.on().values() if isinstance(effect, Effect))


def per_joint(value: Any, joint: int) -> Any:
    """Read a table's value for one joint: a tuple by index; a single number stands for every joint."""
    if isinstance(value, tuple):
        return value[joint] if joint < len(value) else 0.0
    return value


def at_tip(value: Any, link: int, links: int) -> Any:
    """Read a table's value for the tip of one link: a tuple by index; a single number stands for the last link."""
    return per_joint(value, link) if isinstance(value, tuple) or link == links - 1 else 0.0


def per_motor(value: Any, chain: Chain) -> ca.SX:
    """Read a table's value for each joint that moves, (joints, 1): zero for a passive joint, which has no motor."""
    links = chain.links
    found = [0.0 if links[i].table.passive else per_joint(value, i) for i in chain.moving]
    return ca.vertcat(ca.SX(0, 1), *found)
