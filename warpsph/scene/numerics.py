"""How the equations of a scene are discretised: the smoothing kernel, viscosity, density, and steps in time."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpsph.scene.fields import Coefficient, Duration, NotNegative, Part, Real, fault

# More stages are not tried: rounding grows with their square.
MOST_STAGES = 101


class Smoothing(Part):
    """The smoothing kernel."""

    kernel: Literal["wendland_c2", "quintic_spline", "cubic_spline", "gaussian"] = Field(
        "quintic_spline", description="Smoothing kernel W [-]; with quintic_spline lattices resist waves least."
    )
    ratio: Annotated[Real, Field(ge=1, le=4)] = Field(
        1.42,
        description="Smoothing length over particle spacing, h/dx [-]; quintic_spline keeps lattices in order at 1.38 "
        "to 1.43, wendland_c2 at 1.4; steep waves want quintic_spline at 1.6 to 1.9.",
    )


class ViscosityField(Part):
    """How forces come of the materials' own viscosities."""

    form: Literal["morris", "cleary", "stress"] = Field(
        "morris",
        description="Force of a pair [-]: morris, cleary (along the line between, so that no torque is left over), or "
        "stress, the divergence of the stress from velocity gradients.",
    )
    mean: Literal["arithmetic", "harmonic"] = Field(
        "harmonic", description="Viscosity between the two particles of a pair [-]."
    )
    weights: Literal["plain", "balanced"] = Field(
        "plain",
        description="Weights of pairs [-]: plain, or balanced, which leave a linear flow alone where particles are in "
        "disorder too, for a sweep more; not with cleary.",
    )
    stages: Annotated[int, Field(strict=True, ge=1, le=MOST_STAGES)] | None = Field(
        None,
        description="Sweeps of a step for viscosity [-]: 1 is explicit, more allow a longer step; as many as let sound "
        "alone limit the step when absent.",
    )

    @model_validator(mode="after")
    def _can_be_stepped(self) -> ViscosityField:
        if self.stages == 2:
            raise fault("two stages take no longer a step than one; 1, or 3 and more", "stages")
        if self.weights == "balanced" and self.form == "cleary":
            raise fault("balanced goes with morris and stress, not with cleary", "weights")
        return self


class DensityDiffusion(Part):
    """Diffusion of density between particles of one fluid, which keeps the pressure smooth."""

    model: Literal["none", "molteni_colagrossi", "fourtakas", "antuono"] = Field(
        "fourtakas",
        description="What is diffused [-]; fourtakas leaves fluid at rest alone, antuono (delta-SPH) any linear "
        "pressure, for a sweep more.",
    )
    delta: Coefficient = Field(0.1, description="Coefficient of the diffusion [-].")


class DensityFilterField(Part):
    """Density made anew from the density all around, now and then."""

    model: Literal["none", "shepard", "mls"] = Field(
        "none",
        description="How it is interpolated [-]: none leaves it, shepard is exact for constants, mls (moving least "
        "squares) for linear fields.",
    )
    every: Annotated[int, Field(strict=True, gt=0, le=1_000_000_000)] = Field(
        20, description="Steps from one time to the next [-]."
    )


class Shifting(Part):
    """A drift of particles to where there are fewer of them, which keeps them in order."""

    model: Literal["none", "fickian"] = Field(
        "none",
        description="How particles drift beside their velocity [-]: none, or fickian, against the gradient of their "
        "concentration at the pace of the shear rate, and along a free surface only.",
    )
    strength: Coefficient = Field(6.0, description="Coefficient of the drift, A [-].")
    velocity: Literal["own", "local"] = Field(
        "own",
        description="Velocity of a particle that drifts [-]: its own, so that momentum is conserved, or the "
        "velocity of the place it drifts to, in materials with a viscosity of their own.",
    )


class WarmUp(Part):
    """Settling before the release, from t = -duration to t = 0."""

    duration: Duration = Field(description="How long the settling lasts [s].")
    damping: NotNegative = Field(description="Rate at which velocity is damped meanwhile [1/s].")
    settling: NotNegative | None = Field(
        None,
        description="How long a fill keeps the density of rest while its particles find their places [s]; half the "
        "duration when absent.",
    )

    @property
    def settling_time(self) -> float:
        """How long a fill keeps the density of rest [s]."""
        return 0.5 * self.duration if self.settling is None else min(self.settling, self.duration)


class RunField(Part):
    """When to stop, and how far a step reaches."""

    end_time: Duration = Field(description="End of the run [s]; t = 0 is the release.")
    courant: Annotated[Real, Field(ge=0.001, le=1)] = Field(
        0.5, description="Courant number: dt = courant h / (c + u) [-]."
    )
    time_step: Annotated[Real, Field(ge=1e-9, le=1)] | None = Field(
        None, description="Fixed time step of the scheme mueller [s]; other schemes find their own."
    )
    integrator: Literal["verlet", "predictor_corrector", "runge_kutta", "leapfrog"] = Field(
        "verlet",
        description="How a step is taken [-]: verlet, predictor_corrector (Heun) or runge_kutta (midpoint rule), all "
        "of second order; verlet keeps energy best; predictor_corrector does not move bodies; leapfrog belongs to the "
        "scheme mueller, which knows no other.",
    )
    max_steps: Annotated[int, Field(strict=True, gt=0, le=2_000_000_000)] | None = Field(
        None, description="Number of steps from which on the run stops, at its next record [-]; no limit when absent."
    )
    absurd: Literal["stop", "drop"] = Field(
        "stop",
        description="What an absurd particle does, one faster than sound, say [-]: stop ends the run; drop takes it "
        "out and counts it, up to one in a thousand.",
    )
