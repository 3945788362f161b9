"""What the materials of a scene say of viscosity: laws, numbers, and the stages in which a step takes them."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import warp as wp

from warpsph.kernels.artificial_viscosity import artificial_share
from warpsph.kernels.rheology import Rheology
from warpsph.kernels.viscosity import viscous_courant
from warpsph.scene.numerics import MOST_STAGES, ViscosityField
from warpsph.scene.scene import Scene

# Beyond their limit stages are unstable at once, and viscous_courant is a limit up to a disorder of 0.2 dx.
MARGIN = 0.9


@dataclass(frozen=True)
class Stage:
    """Weights of one stage of RKL2, as `viscous_stage` names them, and the part of the step that lies behind it."""

    before: float
    second: float
    rate: float
    first: float
    elapsed: float


def legendre_stages(count: int) -> list[Stage]:
    """The stages of the second-order Runge-Kutta-Legendre scheme, 3 or more: Meyer, Balsara & Aslam (2014), eq 16-17.

        b_0 = b_1 = b_2 = 1/3, b_j = (j^2 + j - 2) / (2 j (j + 1)), a_j = 1 - b_j, w = 4 / (s^2 + s - 2)
        mu_j = (2 j - 1) / j b_j / b_(j-1), nu_j = -(j - 1) / j b_j / b_(j-2), mu'_j = w mu_j, gamma'_j = -a_(j-1) mu'_j

    with mu'_1 = w b_1. A step is stable up to (s^2 + s - 2) / 4 times the step of Euler's scheme.
    """
    b = [1 / 3, 1 / 3, *((j * j + j - 2) / (2 * j * (j + 1)) for j in range(2, count + 1))]
    w = 4 / (count**2 + count - 2)
    stages = [Stage(0.0, 0.0, 0.0, w * b[1], w * b[1])]
    elapsed = [0.0, w * b[1]]
    for j in range(2, count + 1):
        mu, nu = (2 * j - 1) / j * b[j] / b[j - 1], -(j - 1) / j * b[j] / b[j - 2]
        rate, first = w * mu, -(1 - b[j - 1]) * w * mu
        elapsed.append(mu * elapsed[-1] + nu * elapsed[-2] + rate + first)
        stages.append(Stage(mu, nu if j > 2 else 0.0, rate, first, elapsed[-1]))  # a_0 is none
    return stages


def step_in_courants(stages: int) -> float:
    """The longest stable step with so many stages, over the step that viscous_courant gives a single sweep.

    A single sweep takes a velocity that is predicted, which halves the step of Euler's scheme.
    """
    return 1.0 if stages == 1 else MARGIN * 2.0 * (stages**2 + stages - 2) / 4.0


def needed_stages(ratio: float) -> int:
    """Stages for `ratio` times the step of a single sweep: 1, or an odd one, which damps the fastest best."""
    stages = 1
    while stages < MOST_STAGES and step_in_courants(stages) < ratio:
        stages += 2
    return stages


@dataclass(frozen=True)
class Viscous:
    """The viscosity of a model.

    Attributes:
        form: A name of VISCOSITY, or "stress".
        mean: A name of MEAN.
        balanced: Whether the weights of pairs leave a linear flow alone in disorder too.
        law: A name of RHEOLOGY; None where every viscosity is a constant.
        regularisation: A name of REGULARISATION.
        rheology: Numbers for kernels, one entry for each fluid, and one for particles that have left.
        greatest: The greatest kinematic viscosity that a pair can have [m2/s].
        stages: Sweeps of a step for viscosity.
        longest_step: The longest stable step [s].
    """

    form: str
    mean: str
    balanced: bool
    law: str | None
    regularisation: str
    rheology: Rheology
    greatest: float
    stages: int
    longest_step: float


def viscous(scene: Scene, device: wp.Device) -> Viscous | None:
    """The viscosity of the scene's fluids; None where no material has one of its own, or its scheme sees to it."""
    materials = [scene.materials[fluid.material] for fluid in scene.fluids]
    laws = [material.viscosity for material in materials]
    if not any(laws) or scene.scheme != "weakly_compressible":  # others have a way of their own
        return None

    def table(values: list[float]) -> wp.array:
        # One entry more, for particles that have left.
        return wp.array(np.array([*values, values[0]], dtype=np.float32), device=device)

    numbers = Rheology()
    numbers.consistency = table([law.consistency if law else 0.0 for law in laws])
    numbers.exponent = table([(law and law.exponent) or 1.0 for law in laws])
    numbers.yield_stress = table([(law and law.yield_stress) or 0.0 for law in laws])
    numbers.viscosity_max = table([(law and law.viscosity_max) or math.inf for law in laws])

    names = {law.law for law in laws if law}
    flows = names | ({"newtonian"} if None in laws else set())
    law = None if flows == {"newtonian"} else flows.pop() if len(flows) == 1 else "herschel_bulkley"
    kinds = [law.regularisation for law in laws if law and law.regularisation]

    settings = scene.viscosity
    limits = [law.viscosity_limit if law else 0.0 for law in laws]
    pairs = [
        (2.0 * a * b / (a + b) if a + b else 0.0) if _takes_harmonic_mean(settings) else 0.5 * (a + b)
        for a, b in product(limits, limits)
    ]
    densities = [material.density for material, _ in product(materials, materials)]
    greatest = max(mu / density for mu, density in zip(pairs, densities, strict=True))
    single = viscous_courant(settings.form, scene.smoothing.kernel) * scene.smoothing_length**2 / greatest
    by_sound = scene.run.courant * scene.smoothing_length / max(material.sound_speed for material in materials)
    stages = settings.stages or needed_stages(by_sound / single)
    return Viscous(
        form=settings.form,
        mean=settings.mean,
        balanced=settings.weights == "balanced",
        law=law,
        regularisation=kinds[0] if kinds else "bi_viscous",
        rheology=numbers,
        greatest=greatest,
        stages=stages,
        longest_step=single * step_in_courants(stages),
    )


def kinematic_viscosities(scene: Scene) -> dict[str, tuple[float, float]]:
    """Of each material [m2/s]: its own, the greatest where it changes, and the artificial one read as a real one."""
    share = artificial_share(scene.artificial_viscosity, scene.smoothing.kernel, scene.dimensions)
    return {
        name: (
            material.viscosity.viscosity_limit / material.density if material.viscosity else 0.0,
            share * material.alpha * material.sound_speed * scene.smoothing_length,
        )
        for name, material in scene.materials.items()
    }


def _takes_harmonic_mean(settings: ViscosityField) -> bool:
    """Whether no force of a pair exceeds the force with the harmonic mean; the stress form adds up stresses too."""
    return settings.form != "stress" and settings.mean == "harmonic"
