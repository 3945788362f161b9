"""Impulse waves by hand: the formulae of Evers, Heller, Fuchs, Hager & Boes (2019), VAW-Mitteilungen 254.

Equations have the numbers of that manual. They come from experiments with granular slides in channels (2-D) and
basins (3-D); `Slide.outside` tells where a slide leaves their range. SI units, angles in degrees.
"""

import math
from dataclasses import dataclass

# Within which the experiments were: F, S, M, B, slope [degrees], X (2-D) and r / h (3-D), P.
RANGES_2D = {
    **{"F": (0.86, 6.83), "S": (0.09, 1.64), "M": (0.11, 10.02), "B": (0.74, 3.33), "slope": (30.0, 90.0)},
    **{"X": (2.7, 59.2), "P": (0.17, 8.13)},
}
RANGES_3D = {
    **{"F": (0.40, 3.40), "S": (0.15, 0.60), "M": (0.25, 1.00), "B": (0.83, 5.00), "slope": (30.0, 90.0)},
    **{"X": (1.0, 16.0), "P": (0.13, 2.08)},
}


@dataclass(frozen=True)
class Slide:
    """A slide where it meets the water.

    Attributes:
        speed: Of its centre at the impact, V_s [m/s].
        thickness: s [m].
        volume: With its pores [m3].
        density: With its pores [kg/m3].
        slope: alpha [degrees].
        width: Of the slide, in 2-D of the channel, b [m].
        depth: Of still water, h [m].
        water: Density of the water [kg/m3].
        gravity: [m/s2].
    """

    speed: float
    thickness: float
    volume: float
    density: float
    slope: float
    width: float
    depth: float
    water: float = 1000.0
    gravity: float = 9.81

    @property
    def froude(self) -> float:
        """F = V_s / sqrt(g h)."""
        return self.speed / math.sqrt(self.gravity * self.depth)

    @property
    def relative_thickness(self) -> float:
        """S = s / h."""
        return self.thickness / self.depth

    @property
    def relative_mass(self) -> float:
        """M = rho_s V / (rho_w b h^2)."""
        return self.density * self.volume / (self.water * self.width * self.depth**2)

    @property
    def relative_width(self) -> float:
        """B = b / h."""
        return self.width / self.depth

    @property
    def cosine(self) -> float:
        """cos(6 alpha / 7)."""
        return math.cos(math.radians(6.0 / 7.0 * self.slope))

    @property
    def product(self) -> float:
        """Impulse product parameter P = F S^(1/2) M^(1/4) cos(6 alpha / 7)^(1/2), eq 3.12."""
        return self.froude * math.sqrt(self.relative_thickness * self.cosine) * self.relative_mass**0.25

    def outside(self, distance: float | None = None, *, basin: bool = False) -> list[str]:
        """What lies outside of the experiments, a word for each, at a `distance` [m]; for a `basin` those in 3-D."""
        values = {"F": self.froude, "S": self.relative_thickness, "M": self.relative_mass, "B": self.relative_width}
        values |= {"slope": self.slope, "P": self.product}
        if distance is not None:
            values["X"] = distance / self.depth
        ranges = RANGES_3D if basin else RANGES_2D
        return [
            f"{name} = {value:.3g} (experiments had {ranges[name][0]:g} to {ranges[name][1]:g})"
            for name, value in values.items()
            if not ranges[name][0] <= value <= ranges[name][1]
        ]


@dataclass(frozen=True)
class ImpulseWave:
    """A wave in a channel, or a crest or trough in a basin.

    Attributes:
        height: From trough to crest [m]; not a number in a basin.
        amplitude: Above still water, of a trough below it [m].
        period: [s].
        celerity: [m/s].
        length: [m].
    """

    height: float
    amplitude: float
    period: float
    celerity: float
    length: float


def near_channel(slide: Slide) -> tuple[float, ImpulseWave]:
    """Where the largest wave is in a channel, x_M [m] from the impact, and that wave: eq 3.13 to 3.18.

    H_M = 5/9 P^(4/5) h, x_M = 11/2 P^(1/2) h, T_M = 9 P^(1/2) sqrt(h / g), a_M = 4/5 H_M, c = sqrt(g (h + a)), L = c T.
    """
    P, h = slide.product, slide.depth
    height = 5.0 / 9.0 * P**0.8 * h
    return 5.5 * math.sqrt(P) * h, _wave(slide, height, 9.0 * math.sqrt(P * h / slide.gravity))


def far_channel(slide: Slide, distance: float) -> ImpulseWave:
    """The wave in a channel at a `distance` x [m] beyond x_M: eq 3.17 to 3.20.

    H = 3/4 (P X^(-1/3))^(4/5) h, T = 9 P^(1/4) X^(5/16) sqrt(h / g), X = x / h. At x_M it does not join `near_channel`:
    H / H_M is 1.13 there for P = 0.13, and 0.78 for P = 2.08.
    """
    P, X, h = slide.product, distance / slide.depth, slide.depth
    height = 0.75 * (P * X ** (-1.0 / 3.0)) ** 0.8 * h
    return _wave(slide, height, 9.0 * P**0.25 * X**0.3125 * math.sqrt(h / slide.gravity))


def _wave(slide: Slide, height: float, period: float) -> ImpulseWave:
    celerity = math.sqrt(slide.gravity * (slide.depth + 0.8 * height))
    return ImpulseWave(height, 0.8 * height, period, celerity, celerity * period)


# Of the first crest, the first trough and the second crest: factors of the decay with distance and with angle.
DECAY = {"first crest": (0.4, 3.2), "first trough": (0.4, 3.6), "second crest": (0.1, 3.0)}


def near_basin(slide: Slide, angle: float = 0.0) -> tuple[float, dict[str, float]]:
    """How far from the impact the first row of waves is in a basin, r_0 [m], and their amplitudes [m]: eq 3.22 to 3.28.

    `angle` gamma is that from the axis of the slide [degrees].
    """
    P, B, ca, h, b = slide.product, slide.relative_width, slide.cosine, slide.depth, slide.width
    ahead = 2.5 * (P * B * ca) ** 0.25 * h
    beside = 0.5 * b + 1.5 * (P * ca) ** 0.25 * h
    turn = math.radians(angle)
    reach = math.sqrt((ahead * beside) ** 2 / ((ahead * math.sin(turn)) ** 2 + (beside * math.cos(turn)) ** 2))
    return reach, {
        "first crest": 0.20 * math.sqrt(P) * B**0.75 * ca**0.25 * h,
        "first trough": 0.35 * math.sqrt(P * B * ca) * h,
        "second crest": 0.14 * (P * B * ca) ** 0.25 * h,
    }


def far_basin(slide: Slide, distance: float, angle: float = 0.0) -> dict[str, float]:
    """Amplitudes in a basin [m] at a `distance` r [m] from the impact and an `angle` [degrees]: eq 3.25, 3.29 to 3.31.

    a = a_0 exp(-k (a_0 / h)^(-0.3) sqrt(r* / h)) sech(c gamma / 90)^(ca exp(-0.15 sqrt(r* / h))), r* = r - r_0.
    """
    reach, start = near_basin(slide, angle)
    far = math.sqrt(max(distance - reach, 0.0) / slide.depth)
    found = {}
    for name, amplitude in start.items():
        k, c = DECAY[name]
        with_distance = math.exp(-k * (amplitude / slide.depth) ** -0.3 * far)
        with_angle = math.cosh(c * angle / 90.0) ** -(slide.cosine * math.exp(-0.15 * far))
        found[name] = amplitude * with_distance * with_angle
    return found


def in_words(slide: Slide, distance: float | None = None, *, basin: bool = False, angle: float = 0.0) -> list[str]:
    """What the formulae say of a slide, a line each: at its largest, and at a `distance` [m] if one is given."""
    lines = [
        f"F = {slide.froude:.3g}, S = {slide.relative_thickness:.3g}, M = {slide.relative_mass:.3g}, "
        f"B = {slide.relative_width:.3g}, impulse product parameter P = {slide.product:.3g}"
    ]
    if basin:
        reach, start = near_basin(slide, angle)
        lines.append(f"at {reach:.4g} m:  {_amplitudes(start)}")
        if distance is not None:
            if distance < reach:
                lines.append(f"{distance:g} m is nearer than the first row of waves: no formula")
            else:
                lines.append(f"at {distance:.4g} m:  {_amplitudes(far_basin(slide, distance, angle))}")
    else:
        place, wave = near_channel(slide)
        lines.append(f"at {place:.4g} m:  {_of(wave)}")
        if distance is not None:
            if distance < place:
                lines.append(f"{distance:g} m is nearer than the largest wave: no formula")
            else:
                lines.append(f"at {distance:.4g} m:  {_of(far_channel(slide, distance))}")
    lines += [f"outside of the experiments: {word}" for word in slide.outside(distance, basin=basin)]
    return lines


def _of(wave: ImpulseWave) -> str:
    return (
        f"height {wave.height:.3g} m, amplitude {wave.amplitude:.3g} m, period {wave.period:.3g} s, "
        f"celerity {wave.celerity:.3g} m/s, length {wave.length:.3g} m"
    )


def _amplitudes(found: dict[str, float]) -> str:
    return ", ".join(f"{name} {amplitude:.3g} m" for name, amplitude in found.items())
