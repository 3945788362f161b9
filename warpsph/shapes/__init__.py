"""Geometry of walls and bodies: outlines, surfaces in space, meshes."""
