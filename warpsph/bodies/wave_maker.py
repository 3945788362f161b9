"""The way of a paddle: from the waves that a scene asks for to rows of a motion, by the theory of wave makers.

What the paddle, the depth or breaking forbids is refused with the greatest height that would do.
"""

from __future__ import annotations

import math

import numpy as np

from warpsph.bodies.motion import Motion, MotionTable, read_table
from warpsph.scene.waves import WaveMaker
from warpsph.theory import waves as theory

# Rows of the table in a period, of the shortest component where there are many.
ROWS = 48
# A flap may lean by so much to either side [degrees].
MOST_LEAN = 25.0
# The highest of a hundred waves of a sea, over its significant height: Longuet-Higgins (1952).
HIGHEST = 1.53


class WaveError(ValueError):
    """The waves cannot be made; `field` is the field of the wave maker at fault."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


def paddle_motion(maker: WaveMaker, end_time: float, gravity: float) -> Motion:
    """The motion of the paddle of a wave maker, until `end_time` [s].

    Raises:
        WaveError: the waves break, the paddle cannot make them, or the table is none.
    """
    if maker.waves == "table":
        return _measured(maker)
    hinge = None if maker.hinge is None else maker.hinge - maker.bed
    about = {"depth": maker.depth, "gravity": gravity}
    _refuse_breaking(maker, gravity)
    if maker.waves == "solitary":
        t, way = theory.solitary_paddle(height=maker.height, **about)
        starts = [n * (maker.every or 0.0) for n in range(maker.count or 1)]
        time = np.unique(np.round(np.concatenate([start + t for start in starts]), 6))
        way = np.sum([np.interp(time - start, t, way) for start in starts], axis=0)
    else:
        shortest = maker.period / (theory.HIGHEST if maker.waves in ("irregular", "focused") else 1.0)
        rows = math.ceil(max(end_time - maker.begin, 2.0 * shortest) * ROWS / shortest) + 3
        time = shortest / ROWS * np.arange(rows)
        if maker.waves == "regular":
            order = maker.order or (1 if hinge is not None else 2)
            way = theory.regular_paddle(
                time, height=maker.height, period=maker.period, order=order, hinge=hinge, **about
            )
        else:
            way = theory.components_paddle(time, components(maker, gravity), hinge=hinge, **about)
        ramp = maker.ramp if maker.ramp is not None else 0.0 if maker.waves == "focused" else maker.period
        if ramp:
            way = way * 0.5 * (1.0 - np.cos(math.pi * np.clip(time / ramp, 0.0, 1.0)))
        way = way - way[0]
    _refuse_paddle(maker, way, hinge)
    if hinge is None:
        shift = np.stack([way, 0.0 * way, 0.0 * way], axis=1)
        return _table(maker, time, shift, 0.0 * way)
    return _table(maker, time, np.zeros((len(way), 3)), np.arctan(way / (maker.depth - hinge)))


def in_words(maker: WaveMaker, end_time: float, gravity: float) -> str:
    """What a wave maker does, in a line for the user; raises as `paddle_motion`."""
    rows = paddle_motion(maker, end_time, gravity).table
    words = f"{maker.waves} waves by a {maker.paddle}"
    if maker.paddle == "piston":
        words += f", stroke {float(np.ptp(rows.shift[:, 0])):.4g} m"
    else:
        words += f", {math.degrees(float(np.ptp(rows.angle))):.3g} degrees"
    if maker.period is not None:
        length = theory.wavelength(maker.period, depth=maker.depth, gravity=gravity)
        words += f", {length:.4g} m long, in water {maker.depth / length:.3g} wavelengths deep"
    if maker.waves == "irregular":
        words += f", seed {1 if maker.seed is None else maker.seed}"
    return words


def components(maker: WaveMaker, gravity: float) -> theory.Components:
    """The components of the sea or of the focused waves that a wave maker makes."""
    about = {"period": maker.period, "spectrum": maker.spectrum or "jonswap", "peak": maker.peak_enhancement or 3.3}
    about["count"] = maker.components or 128
    if maker.waves == "irregular":
        return theory.sea(height=maker.height, seed=1 if maker.seed is None else maker.seed, **about)
    return theory.focused(
        crest=maker.height, place=maker.focus, time=maker.focus_time, depth=maker.depth, gravity=gravity, **about
    )


def _measured(maker: WaveMaker) -> Motion:
    """The motion of a measured paddle, which counts from its first row."""
    try:
        rows = read_table(maker.file)
    except ValueError as error:
        raise WaveError("file", str(error)) from None
    # From z to x about y, as bodies count it: that is forward.
    shift, angle = rows.shift - rows.shift[0], rows.angle - rows.angle[0]
    unused = angle if maker.paddle == "piston" else shift
    if np.any(unused):
        words = "angle means nothing to a piston" if maker.paddle == "piston" else "a flap has an angle alone"
        raise WaveError("file", f"{maker.file}: {words}")
    return _table(maker, rows.time - rows.time[0], shift, angle)


def _table(maker: WaveMaker, time: np.ndarray, shift: np.ndarray, angle: np.ndarray) -> Motion:
    pivot = None if maker.hinge is None else (maker.x, 0.0, maker.hinge)
    return Motion("table", pivot=pivot, begin=maker.begin, table=MotionTable(time, shift, angle))


def _refuse_breaking(maker: WaveMaker, gravity: float) -> None:
    """Raise for waves that break where they are made."""
    depth, height = maker.depth, maker.height
    most, by = theory.MCCOWAN * depth, "McCowan"
    if maker.waves != "solitary":
        miche = theory.miche_height(maker.period, depth=depth, gravity=gravity)
        if miche < most:
            most, by = miche, "Miche"
    if maker.waves == "irregular":
        most, by = most / HIGHEST, f"{by}, of the highest wave in a hundred"
    if height > most:
        raise WaveError("height", f"{height:g} m breaks in {depth:g} m of water; {_down(most):g} m is the most ({by})")
    if maker.waves == "regular" and (maker.order or 2) == 2 and maker.paddle == "piston":
        length = theory.wavelength(maker.period, depth=depth, gravity=gravity)
        most = theory.MOST_URSELL * depth**3 / length**2
        if height > most:
            raise WaveError(
                "height",
                f"{height:g} m is too high for waves of second order, {length:.3g} m long in {depth:g} m of water; "
                f"{_down(most):g} m is the most (Madsen), or order: 1",
            )


def _refuse_paddle(maker: WaveMaker, way: np.ndarray, hinge: float | None) -> None:
    """Raise where the paddle has not the stroke, leans too far, or waves run over it."""
    stroke = float(np.ptp(way))
    # Heights go about as strokes.
    if maker.longest_stroke is not None and stroke > maker.longest_stroke:
        most = _down(maker.height * maker.longest_stroke / stroke)
        if maker.waves == "solitary" and (maker.count or 1) == 1:
            d = maker.depth  # S^2 = 16 H (H + d) / 3
            most = _down(0.5 * (math.sqrt(d * d + 0.75 * maker.longest_stroke**2) - d))
        raise WaveError(
            "height",
            f"{maker.height:g} m takes a stroke of {stroke:.3g} m, and the longest is {maker.longest_stroke:g} m; "
            f"{most:g} m is the most",
        )
    if hinge is not None:
        lean = math.degrees(math.atan(float(np.abs(way).max()) / (maker.depth - hinge)))
        if lean > MOST_LEAN:
            most = _down(maker.height * math.tan(math.radians(MOST_LEAN)) / math.tan(math.radians(lean)))
            raise WaveError("height", f"the flap would lean by {lean:.0f} degrees; {most:g} m is the most")
    room = maker.upper_edge - maker.bed - maker.depth
    crest = maker.height * (HIGHEST if maker.waves == "irregular" else 1.0)
    if crest > room:
        raise WaveError("top", f"is {room:.3g} m above the still level, and crests may be {crest:.3g} m high")


def _down(value: float) -> float:
    """The next number of three digits below."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return round(math.floor(value / unit + 1e-9) * unit, 12)
