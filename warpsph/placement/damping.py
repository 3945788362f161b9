"""Damping zones: where they lie and how strong they are, and the refusal of one that is longer than its water."""

from __future__ import annotations

from dataclasses import dataclass

from warpsph.scene.scene import Scene
from warpsph.shapes.points import Array
from warpsph.theory.waves import group_celerity, wavelength

# On its way through a zone and back a wave falls by e to the minus this: to 1 %.
DECAY = 4.6


@dataclass(frozen=True)
class Zone:
    """A damping zone: where it begins and ends, x [m], and the rate of damping at its end [1/s]."""

    begin: float
    end: float
    rate: float


def damping_zones(scene: Scene) -> list[Zone]:
    """The damping zones of a scene.

    A rate that grows as the square of the way into a zone takes half of itself from the amplitude, since half of the
    energy of a wave is kinetic: with D = `DECAY` it is 3 D c_g / length at the end, c_g the group celerity.
    """
    zones = []
    for zone in scene.damping_zones:
        period = zone.period or scene.wave_maker.period
        about = {"depth": zone.depth or scene.wave_maker.depth, "gravity": scene.gravity}
        length = zone.wavelengths * wavelength(period, **about)
        begin = zone.end + (length if zone.side == "left" else -length)
        zones.append(Zone(begin, zone.end, 3.0 * DECAY * group_celerity(period, **about) / length))
    return zones


def refuse_long_zones(scene: Scene, position: Array) -> None:
    """Raises SceneError for a zone that is longer than the water is, `position` [m], shape [n, 3]."""
    if not scene.damping_zones:
        return
    low, high = float(position[:, 0].min()), float(position[:, 0].max())
    for i, zone in enumerate(damping_zones(scene)):
        length, path = abs(zone.end - zone.begin), f"damping_zones[{i}]"
        room = zone.end - low if zone.end > zone.begin else high - zone.end
        room = min(room, high - low)
        if length >= room:
            most = room / length * scene.damping_zones[i].wavelengths
            words = f"the zone is {length:.3g} m long, and its water reaches {max(room, 0.0):.3g} m from its end"
            raise scene.error(f"{path}.wavelengths", f"{words}; less than {max(most, 0.0):.3g} fit")
