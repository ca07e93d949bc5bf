"""What an effect may add to joints and links, before they are a chain."""

from typing import TYPE_CHECKING, Any

import casadi as ca

from flexlin.mechanics.body import Moments, RigidMass
from flexlin.scene.effects import EffectTable

if TYPE_CHECKING:
    from flexlin.mechanics.links import BentLink


class PartsEffect(EffectTable):
    """What an effect may add to joints and links; each method's default adds nothing."""

    def frees_motor(self, joint: int) -> bool:
        """Return whether the effect gives a joint's motor a coordinate of its own.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        bool
            By default what the class says of all.
        """
        return self.frees_motors

    def frees_bearing(self, joint: int) -> bool:
        """Return whether the effect lets a joint's bearing give across its direction, by two coordinates.

        Parameters
        ----------
        joint : int
            Number of the joint, from 0.

        Returns
        -------
        bool
            By default what the class says of all.
        """
        return self.frees_bearings

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

    def section_inertia(self, link: "BentLink") -> tuple[Any, Any, Any] | None:
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

    def tip_displacement(self, link: "BentLink") -> tuple[ca.SX, ca.SX]:
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

    def tip_turn(self, link: "BentLink") -> tuple[ca.SX, ca.SX]:
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

    def link_moments(self, link: "BentLink") -> Moments | None:
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
