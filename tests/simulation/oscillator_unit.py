"""A damped mass on a spring as a functional mock-up unit, built by pythonfmu."""

from __future__ import annotations

from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Oscillator(Fmi2Slave):
    """It gives up where the spring pushes, and fails where the damper does."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.stiffness = 4.0
        self.damping = 0.3
        self.position = 1.0
        self.speed = 0.0
        for name in ("stiffness", "damping"):
            self.register_variable(
                Real(
                    name,
                    causality=Fmi2Causality.parameter,
                    variability=Fmi2Variability.tunable,
                )
            )
        for name in ("position", "speed"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, _time: float, step: float) -> bool:
        """Go a communication step in small ones (semi-implicit Euler)."""
        if self.damping < 0.0:
            raise ValueError("the damper pushes")
        many = max(1, round(step / 1e-3))
        for _ in range(many):
            pull = self.stiffness * self.position + self.damping * self.speed
            self.speed -= pull * step / many
            self.position += self.speed * step / many
        return self.stiffness > 0.0
