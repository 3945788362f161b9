"""Damping zones: where they lie and how strong they are, and the refusal of one that is longer than its water."""

from __future__ import annotations

from dataclasses import dataclass

from warpsph.scene.scene import Scene
from warpsph.scene.waves import DampingZone
from warpsph.shapes.points import Array
from warpsph.theory.waves import group_celerity, wavelength

# On its way through a zone and back a wave falls by e to the minus this: to 1 %.
DECAY = 4.6
# A shorter zone stops waves rather than taking them up.
LEAST_SPACINGS = 4.0


@dataclass(frozen=True)
class Zone:
    """A damping zone: where it begins and ends, x [m], and the rate of damping at its end [1/s]."""

    begin: float
    end: float
    rate: float


def _waves(scene: Scene, zone: DampingZone) -> tuple[float, dict[str, float]]:
    """The period [s] of the waves that a zone is to take up, and what else their length comes from."""
    maker = scene.wave_maker
    period, depth = zone.period or (maker and maker.period), zone.depth or (maker and maker.depth)
    assert period and depth, "a zone without them is refused where there is no wave maker"
    return period, {"depth": depth, "gravity": scene.gravity}


def zone_length(scene: Scene, i: int) -> float:
    """Length of a damping zone of a scene [m]."""
    zone = scene.damping_zones[i]
    period, about = _waves(scene, zone)
    return zone.wavelengths * wavelength(period, **about)


def damping_zones(scene: Scene) -> list[Zone]:
    """The damping zones of a scene.

    A rate that grows as the square of the way into a zone takes half of itself from the amplitude, since half of the
    energy of a wave is kinetic: with D = `DECAY` it is 3 D c_g / length at the end, c_g the group celerity.
    """
    zones = []
    for i, zone in enumerate(scene.damping_zones):
        period, about = _waves(scene, zone)
        length = zone_length(scene, i)
        begin = zone.end + (length if zone.side == "left" else -length)
        zones.append(Zone(begin, zone.end, 3.0 * DECAY * group_celerity(period, **about) / length))
    return zones


def refuse_long_zones(scene: Scene, position: Array) -> None:
    """Raises SceneError for a zone that is longer than the water is, `position` [m], shape [n, 3]."""
    if not scene.damping_zones:
        return
    for i in range(len(scene.damping_zones)):
        length = zone_length(scene, i)
        if length < LEAST_SPACINGS * scene.spacing:
            words = f"the zone is {length:.3g} m long, less than {LEAST_SPACINGS:g} spacings: it damps nothing"
            raise scene.error(f"damping_zones[{i}].wavelengths", words)
    low, high = float(position[:, 0].min()), float(position[:, 0].max())
    for i, zone in enumerate(damping_zones(scene)):
        length, path = abs(zone.end - zone.begin), f"damping_zones[{i}]"
        room = zone.end - low if zone.end > zone.begin else high - zone.end
        room = min(room, high - low)
        if length >= room:
            most = room / length * scene.damping_zones[i].wavelengths
            words = f"the zone is {length:.3g} m long, and its water reaches {max(room, 0.0):.3g} m from its end"
            raise scene.error(f"{path}.wavelengths", f"{words}; less than {max(most, 0.0):.3g} fit")
