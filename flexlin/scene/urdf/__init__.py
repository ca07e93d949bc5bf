"""Robots from URDF files: read safely, a chain chosen, written as the tables of a scene."""
