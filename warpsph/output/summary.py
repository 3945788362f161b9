"""What a run came to, in words for the terminal."""

from pathlib import Path
from typing import Any


def summary(facts: dict[str, Any], folder: Path) -> str:
    """The facts of a run.json in lines, of a run in `folder`."""
    speed, conservation = facts["speed"], facts["conservation"]
    lines = [
        f"{facts['title']}: {facts['outcome']} at t = {facts['time [s]']:g} s",
        f"  particles       {facts['counts']['particles']:,} and {facts['counts']['wall points']:,} wall points",
        f"  steps           {speed['steps']:,}, {speed['particle updates per second'] / 1e6:.2f} M particle-updates/s",
        f"  first steps     {speed['seconds to the first steps']:.1f} s after the start",
        f"  whole run       {speed['seconds, all output included']:.1f} s, all output included",
        f"  mass            {conservation['mass / mass placed']:.9f} of what was placed",
        f"  behind walls    {facts['particles behind walls']:,} particles",
    ]
    if left := facts.get("left"):
        unit = next(name for name in left if name.startswith("volume"))
        lines.append(
            f"  left the tank   {left['particles']:,} particles, {left[unit]:.3g} {unit[8:-1]}, "
            f"{left['share of all particles']:.2%} of all, from t = {left['first [s]']:.3f} s on (left.csv)"
        )
        if left["dropped as absurd"]:
            lines.append(f"  dropped         {left['dropped as absurd']:,} of these, which had become absurd")
    if "energy drift / converted" in conservation:
        lines.append(
            f"  energy sum      drifts by {conservation['energy drift / converted']:.2%} of the energy converted"
        )
    for name, gauge in facts["gauges"].items():
        lines.append(
            f"  gauge {name:<9} crest {gauge['crest amplitude [m]']:.4f} m above {gauge['still level [m]']:.4f} m "
            f"at t = {gauge['crest time [s]']:.3f} s{', still rising' if gauge.get('still rising') else ''}"
        )
    lines += _train_lines(facts.get("wave train", {}))
    for name, impact in facts.get("impacts", {}).items():
        lines.append(
            f"  impact of {name:<5} {impact['speed [m/s]']:.3f} m/s at t = {impact['time [s]']:.3f} s, "
            f"Froude number {impact['Froude number']:.3f}, {impact['kinetic energy [J/m]']:.1f} J/m"
        )
    for name, wave in facts.get("waves", {}).items():
        kinetic, potential = wave["kinetic energy [J/m]"], wave["potential energy [J/m]"]
        crest, period = wave["crest amplitude [m]"], wave["period [s]"]
        celerity = f", celerity {wave['celerity [m/s]']:.3f} m/s" if "celerity [m/s]" in wave else ""
        lines += [
            f"  wave at {name:<7} crest {crest:.4f} m, period {period:.2f} s{celerity}",
            f"{'':<18}solitary with R2 = {wave['likeness to a solitary wave, R2']:.3f}",
            f"{'':<18}kinetic {kinetic:.2f} and potential {potential:.2f} J/m, "
            f"{wave['energy / kinetic energy of the impact']:.1%} of the energy of the impact",
        ]
    lines.append(f"  results         {folder}/report.html, {folder}/usd/scene.usda, {folder}/gauges/")
    return "\n".join(lines)


def _train_lines(train: dict[str, Any]) -> list[str]:
    """What a wave maker made, for the terminal."""
    gauges, lines = train.get("gauges", {}), []
    if isinstance(gauges, str):
        return [f"  wave train      {gauges}"]
    for name, gauge in gauges.items():
        period = f", period {gauge['period [s]']:.3f} s" if "period [s]" in gauge else ""
        share = gauge["height / asked for"]
        lines.append(
            f"  waves at {name:<6} height {gauge['height [m]']:.4f} m{period}, {share:.1%} of what was asked for"
        )
    if "reflection" in train:
        found = train["reflection"]
        lines.append(f"  reflection      {found['coefficient']:.1%}, by {found['gauges']}")
    return lines
