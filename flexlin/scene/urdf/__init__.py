"""Robots from URDF files: read safely, a chain chosen, written as the tables of a scene."""

from flexlin.scene.urdf.convert import chain_tables, scene_tables
from flexlin.scene.urdf.robot import Robot, read_robot

__all__ = ["Robot", "chain_tables", "read_robot", "scene_tables"]
