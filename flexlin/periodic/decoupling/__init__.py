"""Fast modes apart from slow ones: superadiabatic decoupling of periodic linear systems."""
