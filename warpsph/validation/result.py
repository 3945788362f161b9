"""One line of a validation: what was measured, what it should be, and who says so."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Result:
    """A measured quantity beside its reference.

    `error` is relative to the reference, `thesis_error` is the thesis's own, `bar` the largest error that passes (or
    the largest value, where there is no error to speak of). None where there is no such number. `why` tells of a bar
    that is known to be missed, why that is so.
    """

    quantity: str
    unit: str
    measured: float
    reference: float | None
    error: float | None = None
    thesis_error: float | None = None
    bar: float | None = None
    passed: bool = True
    source: str = ""
    why: str = ""
    case: str = ""
    seconds: float = 0.0

    @property
    def verdict(self) -> str:
        """Whether the bar is met, missed as it is known to be, or missed since something broke."""
        return "pass" if self.passed else "expected miss" if self.why else "FAIL"

    def cells(self) -> tuple[str, ...]:
        """The line as text."""

        def percent(value: float | None) -> str:
            return "" if value is None else f"{100.0 * value:.2f} %"

        return (
            self.case,
            self.quantity,
            self.unit,
            f"{self.measured:.5g}",
            "" if self.reference is None else f"{self.reference:.5g}",
            percent(self.error),
            percent(self.thesis_error),
            percent(self.bar) if self.error is not None else "" if self.bar is None else f"{self.bar:.3g}",
            self.verdict,
            self.source if self.passed or not self.why else f"{self.source}; {self.why}",
        )


def against(
    quantity: str,
    unit: str,
    measured: float,
    reference: float,
    bar: float,
    source: str,
    thesis_error: float | None = None,
) -> Result:
    """A result whose relative error must not exceed `bar`."""
    error = abs(float(measured) - reference) / abs(reference)
    return Result(quantity, unit, float(measured), reference, error, thesis_error, bar, error <= bar, source)


def at_most(quantity: str, unit: str, measured: float, bar: float, source: str) -> Result:
    """A result that is itself an error, and must not exceed `bar`."""
    return Result(quantity, unit, float(measured), None, None, None, bar, float(measured) <= bar, source)
