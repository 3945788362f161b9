"""A rigid slide that runs down a slope under water, its motion as measured: Zhou & Teng (2010), case A."""

from __future__ import annotations

import numpy as np

from warpsph.measure.compare import compared, read_observed
from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.validation.result import Result, against

SOURCE = "Zhou & Teng (2010)"
END = 1.5  # the first trough and the first crest have passed by then [s]
LEAST, GREATEST = {"g1": -3.91e-3, "g2": -11.21e-3}, {"g2": 7.09e-3}


def measure_submarine_slide(run: Run) -> list[Result]:
    """Bars: troughs of both gauges and the crest of the second 10 %."""
    results = []
    for gauge in run.scene.gauges:
        time, level = read_record(run.folder / "gauges" / f"{gauge.name}.csv").values()
        seen = time <= END
        rest = float(np.median(level[:3]))
        trough, crest = float(level[seen].min() - rest), float(level[seen].max() - rest)
        results.append(against(f"trough at {gauge.name}", "m", trough, LEAST[gauge.name], 0.10, SOURCE))
        if gauge.name in GREATEST:
            results.append(against(f"crest at {gauge.name}", "m", crest, GREATEST[gauge.name], 0.10, SOURCE))
        found = compared(time[seen], level[seen] - rest, *read_observed(gauge.observed))
        results.append(Result(f"skill at {gauge.name}", "", found.skill, 1.0, source="Willmott (1981)"))
    return results
