"""The structural model outside of the FMU: a mass on a spring and a damper.

The mass hangs on the column's top face by a spring and a dashpot of zero length that act alike in
all directions. With u, v the motion of the mass and U, V that of the top face,

    F = k (u - U) + c (v - V)      force on the top face,        m dv/dt = -F.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Damper:
    mass: float  # [kg]
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    displacement: np.ndarray = field(default_factory=lambda: np.zeros(3))  # u [m]
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))  # v [m/s]
    work: float = 0.0  # of F on the top face since time 0 [J]
    heat: float = 0.0  # produced by the dashpot since time 0 [J]

    @classmethod
    def tuned(cls, mass, modal_mass, frequency):
        """Den Hartog's tuning to a mode of a structure, by their mass ratio."""
        ratio = mass / modal_mass
        omega = 2 * np.pi * frequency / (1 + ratio)
        share = np.sqrt(3 * ratio / (8 * (1 + ratio) ** 3))
        return cls(mass, mass * omega**2, 2 * share * mass * omega)

    def force(self, top_displacement, top_velocity):
        """Force on the top face [N]."""
        return self.stiffness * (self.displacement - top_displacement) + self.damping * (
            self.velocity - top_velocity
        )

    def energy(self, top_displacement):
        """Kinetic energy of the mass and energy of the spring [J]."""
        stretch = self.displacement - top_displacement
        return 0.5 * self.mass * self.velocity @ self.velocity, 0.5 * self.stiffness * stretch @ stretch

    def advance(self, dt, start, end, steps=4):
        """Follows the top face from `start` to `end`, each (displacement, velocity), over `dt` seconds.

        Between the two instants the face moves on the cubic that has these values and slopes. Work
        and heat are integrated along with the motion, by the classical Runge-Kutta method.
        """
        (u0, v0), (u1, v1) = start, end

        def top(s):
            """Motion of the face at the fraction s of the step."""
            u = (
                (2 * s**3 - 3 * s**2 + 1) * u0
                + (s**3 - 2 * s**2 + s) * dt * v0
                + (3 * s**2 - 2 * s**3) * u1
                + (s**3 - s**2) * dt * v1
            )
            v = (
                (6 * s**2 - 6 * s) * (u0 - u1) / dt
                + (3 * s**2 - 4 * s + 1) * v0
                + (3 * s**2 - 2 * s) * v1
            )
            return u, v

        def rate(s, y):
            u, v = y[:3], y[3:6]
            top_u, top_v = top(s)
            slip = v - top_v
            force = self.stiffness * (u - top_u) + self.damping * slip
            return np.concatenate([v, -force / self.mass, [force @ top_v, self.damping * slip @ slip]])

        y = np.concatenate([self.displacement, self.velocity, [self.work, self.heat]])
        h = 1 / steps
        for i in range(steps):
            s = i * h
            k1 = rate(s, y)
            k2 = rate(s + h / 2, y + h / 2 * dt * k1)
            k3 = rate(s + h / 2, y + h / 2 * dt * k2)
            k4 = rate(s + h, y + h * dt * k3)
            y = y + h * dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.displacement, self.velocity = y[:3], y[3:6]
        self.work, self.heat = y[6:]
