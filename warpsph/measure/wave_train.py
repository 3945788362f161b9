"""Trains of waves in the records of gauges: heights and periods by zero crossings, spectra, celerity, reflection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpsph.theory.waves import reflection, wavenumber

# Of the height of the record between its crossings: what does not rise so high is a ripple.
RIPPLE = 0.05


@dataclass(frozen=True)
class Train:
    """The waves of one record.

    Attributes:
        count: Waves between up-crossings of the mean level.
        height, period: Means over them [m], [s].
        significant: Mean height of the highest third of them [m].
        spectral: Significant height by the spectrum, 4 sqrt(m0) [m].
        peak_period: Of the spectrum [s].
    """

    count: int
    height: float
    period: float
    significant: float
    spectral: float
    peak_period: float


def find_train(time: np.ndarray, level: np.ndarray) -> Train | None:
    """The waves of a record, `level` [m] at `time` [s], evenly sampled; None where there are less than two."""
    if len(time) < 8:
        return None
    eta = level - level.mean()
    crossings = _up_crossings(time, eta)
    if len(crossings) < 3:
        return None
    heights = np.array([np.ptp(eta[(time >= a) & (time < b)]) for a, b in pairwise(crossings)])
    highest = np.sort(heights)[::-1]
    f, density = spectrum(time, level)
    return Train(
        count=len(heights),
        height=float(heights.mean()),
        period=float(np.diff(crossings).mean()),
        significant=float(highest[: max(1, round(len(highest) / 3))].mean()),
        spectral=4.0 * float(eta.std()),
        peak_period=float(1.0 / f[density.argmax()]),
    )


def _up_crossings(time: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Times at which a record rises through 0 [s]; it must have been below by more than a ripple since the last."""
    low, found, armed = -RIPPLE * float(np.ptp(eta)), [], False
    for k in range(1, len(eta)):
        armed |= bool(eta[k - 1] < low)
        if armed and eta[k - 1] < 0.0 <= eta[k]:
            found.append(time[k - 1] + (time[k] - time[k - 1]) * eta[k - 1] / (eta[k - 1] - eta[k]))
            armed = False
    return np.array(found)


def spectrum(time: np.ndarray, level: np.ndarray, bands: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and S(f) [m2 s] of an evenly sampled record, 0 left out; its integral is the variance.

    With `bands` neighbouring frequencies are averaged, so many in a band.
    """
    step = (time[-1] - time[0]) / (len(time) - 1)
    window = np.hanning(len(level))
    power = np.abs(np.fft.rfft((level - level.mean()) * window)) ** 2 * 2.0 * step / np.sum(window**2)
    f = np.fft.rfftfreq(len(level), step)
    f, power = f[1:], power[1:]
    if bands and bands > 1:
        whole = len(f) // bands * bands
        f, power = (values[:whole].reshape(-1, bands).mean(axis=1) for values in (f, power))
    return f, power


def harmonic(time: np.ndarray, level: np.ndarray, omega: float) -> complex:
    """a e^(-i phase) [m] of the part a cos(w t - phase) of a record, over the whole periods in it, by least squares."""
    period = 2.0 * math.pi / omega
    whole = time[-1] - math.floor((time[-1] - time[0]) / period + 1e-9) * period
    kept = time >= whole - 1e-9
    t, y = time[kept], level[kept]
    columns = [np.ones_like(t)]
    for n in (1, 2, 3):
        columns += [np.cos(n * omega * t), np.sin(n * omega * t)]
    found = np.linalg.lstsq(np.stack(columns, axis=1), y, rcond=None)[0]
    return complex(found[1], -found[2])


def phase_speed(near: complex, far: complex, distance: float, omega: float, depth: float, gravity: float) -> float:
    """Celerity [m/s] between two gauges `distance` [m] apart, of their harmonics; the number of whole waves between
    them is that which makes it nearest to linear theory."""
    k = float(wavenumber(omega, depth=depth, gravity=gravity))
    turn = -float(np.angle(far / near))  # k distance, but for whole turns
    turn += 2.0 * math.pi * round((k * distance - turn) / (2.0 * math.pi))
    return omega * distance / turn if turn > 0.0 else math.nan


def reflected(
    places: np.ndarray, records: np.ndarray, time: np.ndarray, omega: float, depth: float, gravity: float
) -> tuple[float, float]:
    """Heights [m] of the incident and the reflected regular wave, of gauges at `places` [m], shape [n], with records of
    shape [n, sample_count], by `reflection`."""
    k = float(wavenumber(omega, depth=depth, gravity=gravity))
    amplitudes = np.array([harmonic(time, record, omega) for record in records])
    onward, back = reflection(places, amplitudes, k)
    return 2.0 * onward, 2.0 * back


def reflected_sea(
    places: np.ndarray, records: np.ndarray, time: np.ndarray, depth: float, gravity: float, low: float, high: float
) -> tuple[float, float]:
    """Significant heights [m] of the incident and the reflected sea between the frequencies `low` and `high` [Hz]."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    window = np.hanning(len(time))
    parts = np.fft.rfft((records - records.mean(axis=1)[:, None]) * window, axis=1)
    f = np.fft.rfftfreq(len(time), step)
    energies = np.zeros(2)
    for n in np.flatnonzero((f >= low) & (f <= high)):
        k = float(wavenumber(2.0 * math.pi * f[n], depth=depth, gravity=gravity))
        onward, back = reflection(places, parts[:, n], k)
        energies += np.array([onward, back]) ** 2
    scale = 2.0 / (np.sum(window**2) * len(time))
    onward, back = 4.0 * np.sqrt(scale * energies)
    return float(onward), float(back)
