"""trimesh, which reads meshes, loaded so that Ctrl-C is not lost on the way, some seconds long on a busy machine."""

from warpsph.signals import held

with held():
    import trimesh

__all__ = ["trimesh"]
