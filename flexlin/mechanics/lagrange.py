"""Lagrange's equations of the second kind, from the energies of a system."""

import casadi as ca


def derive_lagrange_equations(
    T: ca.SX, V: ca.SX, R: ca.SX, resistance: ca.SX, s: ca.SX, s_dot: ca.SX, s_ddot: ca.SX
) -> dict[str, ca.SX]:
    """The left side of the equations of motion, and the parts of it that have names.

        d/dt (dT/ds') - dT/ds + dV/ds + dR/ds' + r,   M = d2T/ds'2

    Parameters: T quadratic in s', V, R: energies and Rayleigh's function, (1, 1); resistance r, s, s_dot, s_ddot: (n, 1).
    Returns: residual (n, 1), M (n, n), g (n, 1), damping (n, 1).
    Source: Khang, Dat, Tuan (2019), Eq (55).
    """
    momentum, g, damping = ca.gradient(T, s_dot), ca.gradient(V, s), ca.gradient(R, s_dot) + resistance
    rate_of_momentum = ca.jtimes(momentum, ca.vertcat(s, s_dot), ca.vertcat(s_dot, s_ddot))
    return {
        "residual": rate_of_momentum - ca.gradient(T, s) + g + damping,
        "M": ca.densify(ca.jacobian(momentum, s_dot)),
        "g": ca.densify(g),
        "damping": ca.densify(damping),
    }
