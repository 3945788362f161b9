"""Which scheme a scene asks for."""

from collections.abc import Mapping

from warpsph.scene.scene import Scene
from warpsph.schemes.mueller import Mueller
from warpsph.schemes.weakly_compressible import WeaklyCompressible

SCHEMES: Mapping[str, type[WeaklyCompressible] | type[Mueller]] = {
    "weakly_compressible": WeaklyCompressible,
    "mueller": Mueller,
}


def scheme_of(scene: Scene) -> type[WeaklyCompressible] | type[Mueller]:
    """The class of the scene's scheme."""
    return SCHEMES[scene.scheme]
