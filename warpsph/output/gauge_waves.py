"""What the record of a gauge comes to: still level, arrival, crest, trough, period; how far off an observed one."""

from __future__ import annotations

import numpy as np

from warpsph.measure import compare
from warpsph.output.records import find_crest
from warpsph.scene.scene import Scene

# A wave has arrived, and has crossed the still level, where it stands by this share of its crest off it.
SHARE = 0.1


def describe_gauge(time: np.ndarray, level: np.ndarray) -> dict[str, float]:
    """The wave in the record of a gauge, its numbers by their names; a number that the record lacks is left out.

    Arrival is when the level first strays by a tenth of the crest's amplitude from where it was at first. The trough is
    the lowest level below that. The period is the mean time from one crossing upwards of the still level to the next;
    one counts as such where the level comes from a tenth of the crest below to a tenth above (zero-up-crossing, as in
    Goda (2010), Random Seas and Design of Maritime Structures, section 9.2, with a band against noise).

    Args:
        time: [s], shape [sample_count].
        level: [m], shape [sample_count]; the first is the level at rest.
    """
    numbers = {"still level [m]": float(level[0])}
    crest, crest_time = find_crest(time, level)
    if crest <= 0.0:
        return numbers
    rise = level - level[0]
    arrived = int(np.argmax(np.abs(rise) >= SHARE * crest))
    numbers["arrival [s]"] = float(time[arrived])
    numbers |= {"crest [m]": crest, "crest time [s]": crest_time}
    trough, trough_time = find_crest(time, -level)
    if trough > SHARE * crest:
        numbers |= {"trough [m]": -trough, "trough time [s]": trough_time}
    crossings = _upward(time, rise, SHARE * crest)
    if len(crossings) > 1:
        numbers["period [s]"] = float(np.diff(crossings).mean())
    return numbers


def _upward(time: np.ndarray, rise: np.ndarray, band: float) -> np.ndarray:
    """When `rise` crosses zero upwards, from below -band to above band."""
    found, low = [], None
    for k, value in enumerate(rise):
        if value < -band:
            low = k
        elif value > band and low is not None:
            j = low + int(np.flatnonzero(rise[low : k + 1] < 0.0).max())
            found.append(float(np.interp(0.0, rise[j : j + 2], time[j : j + 2])))
            low = None
    return np.array(found)


def off_observed(time: np.ndarray, level: np.ndarray, observed: dict[str, np.ndarray]) -> dict[str, float]:
    """How far a record is off the observed one, at the observed instants within the record."""
    when, seen = observed.values()
    inside = (when >= time[0]) & (when <= time[-1])
    if not inside.any():
        return {}
    error = np.interp(when[inside], time, level - level[0]) - seen[inside]
    return {
        "observed crest [m]": float(seen.max()),
        "off observed, root mean square [m]": float(np.sqrt(np.mean(error**2))),
    }


def read_observed(scene: Scene) -> dict[str, dict[str, np.ndarray]]:
    """What was observed at the gauges that name a file, by the name of the gauge: time [s], level above rest [m].

    Raises:
        SceneError: a file cannot be read, or does not hold the columns that are named.
    """
    found = {}
    for i, gauge in enumerate(scene.gauges):
        if gauge.observed is None:
            continue
        try:
            time, level = compare.read_observed(gauge.observed)
        except ValueError as error:
            raise scene.error(f"gauges[{i}].observed", str(error)) from None
        found[gauge.name] = {"time [s]": time, "level [m]": level}
    return found
