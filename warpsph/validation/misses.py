"""Bars that are known to be missed, and why: `validate` tells them apart from new failures."""

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

from warpsph.validation.result import Result

_SHARE = "the bar is Nascimento's (2001), of the incident wave; friction of the block decides it, which no source gives"
_SLOPES = "the slide is five spacings high and its waves two to four: not known to converge"
_FIRST_ORDER = "it converges with dx: the growth is 23 and 12 % off with 50 and 100 spacings to the beam"
_BY_EYE = "he saw it, and later; from the least mechanical energy on it is the scheme that adds energy"
_DENSE = "particles settle denser than their lattice: a density summed to 1.3 dx hardly tells"

# By case, patterns of quantities.
EXPECTED: Mapping[str, Mapping[str, str]] = {
    "wedge_entry": {"peak force": _FIRST_ORDER, "growth of the force": _FIRST_ORDER},
    "block_maciel": {"energy of the wave over *": _SHARE, "the same over its kinetic energy *": _SHARE},
    "block_mki": {"energy of the wave over *": _SHARE, "the same over its kinetic energy *": _SHARE},
    "reservoir": {
        "coefficient of discharge less 0.60": "0.64 with a slot ten spacings wide, 0.63 with five: finer ones were not "
        "run"
    },
    "braga_column": {"it is least at, *": _BY_EYE, "level *": _DENSE},
    "braga_pool": {"it is least at, *": _BY_EYE},
    "braga_collision": {"it is least at, *": _BY_EYE},
    "submarine_slide": {"trough at g1": _SLOPES, "crest at g2": _SLOPES},
}


def as_expected(case: str, result: Result) -> Result:
    """The result, with the reason why it misses its bar where that is known."""
    reasons = (why for pattern, why in EXPECTED.get(case, {}).items() if fnmatchcase(result.quantity, pattern))
    return replace(result, why=next(reasons, ""))
