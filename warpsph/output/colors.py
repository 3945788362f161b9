"""Colours of materials and bodies, in pictures and in the cache."""

from __future__ import annotations

from itertools import cycle

from warpsph.scene.scene import Scene

# Of materials that name none, and of bodies.
MATERIAL_PALETTE = ("#2f7fb8", "#8a6a4a", "#3c8d7b", "#b98a2e", "#7d5a9b", "#b0513f")
BODY_PALETTE = ("#8c8f94", "#b0895a", "#6f7f6a", "#a46d62")


def fluid_colors(scene: Scene) -> dict[str, str]:
    """Colour of each fluid, `#rrggbb`: its material's, or the next of the palette where it names none."""
    palette = cycle(MATERIAL_PALETTE)
    colors = {name: material.color or next(palette) for name, material in scene.materials.items()}
    return {fluid.name: colors[fluid.material] for fluid in scene.fluids}


def body_colors(scene: Scene) -> dict[str, str]:
    """Colour of each body, `#rrggbb`."""
    return {body.name: body.color or color for body, color in zip(scene.bodies, cycle(BODY_PALETTE), strict=False)}
