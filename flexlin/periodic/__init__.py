"""Periodic linear systems, numpy and scipy only: usable without any manipulator."""
