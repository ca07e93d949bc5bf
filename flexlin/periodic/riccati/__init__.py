"""Linear-quadratic problems over a period: Riccati and Lyapunov equations in scattering form."""
