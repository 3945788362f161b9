"""From a scene to points: fluids, walls, bodies, images."""
